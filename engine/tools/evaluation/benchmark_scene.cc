#include "engine/tools/evaluation/benchmark_scene.h"

#include <algorithm>
#include <filesystem>

#include "engine/core/error.h"
#include "engine/io/image_io.h"
#include "engine/io/sparse_model.h"

namespace litags {

namespace fs = std::filesystem;

std::string BenchmarkScene::PhotosDir() const { return light.empty() ? dir : dir + "/" + light; }

std::string BenchmarkScene::TruthDir() const {
  const std::string high = dir + "/high";
  return fs::exists(high) ? high : std::string();
}

ReconstructInput BenchmarkScene::Input(const std::string& work_dir,
                                       ReconstructOptions* options) const {
  ReconstructInput input;
  input.images_dir = PhotosDir();
  input.work_dir = work_dir;
  const std::string train = dir + "/transforms_train.json";
  if (!cameras.empty()) {
    input.cameras_path = cameras;
  } else if (!light.empty() && !sfm && fs::exists(train)) {
    input.cameras_path = train;
    options->holdout_every = 0;
  }
  return input;
}

absl::StatusOr<std::vector<TestView>> BenchmarkScene::TestViews() const {
  std::vector<TestView> views;
  const std::string path = dir + "/transforms_test.json";
  if (!fs::exists(path)) return views;
  LITAGS_ASSIGN_OR_RETURN(SparseModel given, ReadCameras(path, "transforms_test.json"));
  for (size_t i = 0; i < given.views.size(); ++i) {
    TestView view{given.views[i], given.distortions[i]};
    if (const auto truth = FindPhoto(TruthDir(), view.view.name); truth.ok()) {
      LITAGS_ASSIGN_OR_RETURN(const ImageInfo info, ReadImageSize(*truth, *truth));
      view.view.camera = view.view.camera.Scaled(info.width, info.height);
    }
    views.push_back(std::move(view));
  }
  return views;
}

absl::StatusOr<std::vector<TestView>> BenchmarkScene::TestViews(const Scene& scene) const {
  LITAGS_ASSIGN_OR_RETURN(std::vector<TestView> given, TestViews());
  if (!sfm) return given;
  std::vector<TestView> views;
  for (const TestView& wanted : given) {
    const auto found = std::find_if(scene.views().begin(), scene.views().end(),
                                    [&](const View& v) { return v.name == wanted.view.name; });
    if (found != scene.views().end()) views.push_back({*found, Distortion()});
  }
  return views;
}

}  // namespace litags
