#include "engine/tools/evaluation/benchmark_scene.h"

#include <algorithm>
#include <filesystem>

#include "engine/core/error.h"
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

absl::StatusOr<std::vector<View>> BenchmarkScene::TestViews(const Scene& scene) const {
  const std::string path = dir + "/transforms_test.json";
  if (!fs::exists(path)) return std::vector<View>();
  LITAGS_ASSIGN_OR_RETURN(SparseModel given, ReadCameras(path, "transforms_test.json"));
  if (!sfm) return given.views;
  std::vector<View> views;
  for (const View& wanted : given.views) {
    const auto found = std::find_if(scene.views().begin(), scene.views().end(),
                                    [&](const View& view) { return view.name == wanted.name; });
    if (found != scene.views().end()) views.push_back(*found);
  }
  return views;
}

}  // namespace litags
