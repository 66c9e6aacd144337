#include "engine/tools/evaluation/benchmark_scene.h"

#include <algorithm>
#include <filesystem>
#include <map>

#include "absl/strings/str_cat.h"
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

std::string BenchmarkScene::DepthDir() const { return sfm ? std::string() : dir + "/depth"; }

absl::StatusOr<ReconstructInput> BenchmarkScene::Input(const std::string& work_dir,
                                                       ReconstructOptions* options) const {
  ReconstructInput input;
  input.images_dir = PhotosDir();
  input.work_dir = work_dir;
  input.cameras_path = cameras;
  if (light.empty() || sfm) return input;
  const std::string train = dir + "/transforms_train.json";
  if (cameras.empty() && fs::exists(train)) {
    input.cameras_path = train;
    options->holdout_every = 0;
  }
  if (input.cameras_path.empty()) return input;
  LITAGS_ASSIGN_OR_RETURN(const std::vector<TestView> test, TestViews());
  if (test.empty()) return input;
  options->holdout_every = 0;
  const char* field = cameras.empty() ? "transforms_train.json" : "--cameras";
  LITAGS_ASSIGN_OR_RETURN(const SparseModel model, ReadCameras(input.cameras_path, field));
  for (const View& view : model.views) {
    const bool in_test = std::any_of(test.begin(), test.end(),
                                     [&](const TestView& t) { return t.view.name == view.name; });
    if (!in_test) continue;
    return InvalidInput("TEST_VIEW_IN_CAMERAS", field,
                        absl::StrCat(input.cameras_path, " has ", view.name, ", a test view of ",
                                     dir, ": it would be trained on; take it out of the cameras"));
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

absl::StatusOr<std::vector<TestView>> BenchmarkScene::TestViews(const Scene& scene,
                                                                const std::string& work_dir) const {
  LITAGS_ASSIGN_OR_RETURN(std::vector<TestView> given, TestViews());
  if (!sfm || given.empty()) return given;
  LITAGS_ASSIGN_OR_RETURN(const SparseModel found, ReadCameras(work_dir + "/cameras", "cameras"));
  std::map<std::string, Distortion> lenses;
  for (size_t i = 0; i < found.views.size(); ++i) {
    lenses[found.views[i].name] = found.distortions[i];
  }
  std::vector<TestView> views;
  for (const TestView& wanted : given) {
    const auto same = std::find_if(scene.views().begin(), scene.views().end(),
                                   [&](const View& v) { return v.name == wanted.view.name; });
    if (same != scene.views().end()) views.push_back({*same, lenses[same->name]});
  }
  return views;
}

}  // namespace litags
