// Helpers of this module's tests: photos of a small cloud of Gaussians whose cameras and points are
// known, so that no COLMAP runs.
#ifndef LITAGS_ENGINE_PIPELINE_RECONSTRUCT_TEST_UTIL_H_
#define LITAGS_ENGINE_PIPELINE_RECONSTRUCT_TEST_UTIL_H_

#include <gtest/gtest.h>

#include <filesystem>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "engine/core/photo.h"
#include "engine/core/temp_dir_test_util.h"
#include "engine/io/colmap_io.h"
#include "engine/io/picture_io.h"
#include "engine/io/test_util.h"
#include "engine/pipeline/engine.h"
#include "engine/train/train_test_util.h"

namespace litags {

constexpr int kPhotos = 8, kWidth = 64, kHeight = 48;
constexpr int kPoints = 150;
constexpr int kIterations = 40;
constexpr char kNoColmap[] = "/nonexistent/colmap";

// A point at every Gaussian. Nothing needs the positions in the photos.
inline SparseModel ModelOf(const Splats& splats, const std::vector<TrainView>& views) {
  SparseModel model;
  for (const TrainView& v : views) {
    model.views.push_back(v.view);
    model.distortions.emplace_back();
  }
  for (size_t i = 0; i < splats.size(); ++i) {
    SparsePoint point;
    for (int k = 0; k < 3; ++k) point.xyz[k] = splats.at(i, kMean + k);
    point.rgb = {90, 90, 90};
    for (size_t v = 0; v < 2 + i % 3; ++v) {
      point.track.push_back({static_cast<int>((i + v) % views.size()), 1.0, 1.0});
    }
    model.points.push_back(std::move(point));
  }
  return model;
}

// A folder with photos, a COLMAP model of them, and work folders.
class Photographs {
 public:
  explicit Photographs(int width = kWidth, int height = kHeight, int points = kPoints) {
    const Splats splats = ColoredCloud(points, 3);
    const std::vector<TrainView> views = DarkViews(splats, kPhotos, width, height);
    std::filesystem::create_directory(dir_ / "images");
    for (const TrainView& v : views) {
      EXPECT_TRUE(WritePng(Photo(v.view.name), PhotoToU8(v.photo)).ok());
    }
    model = ModelOf(splats, views);
    WriteModel();
  }

  void WriteModel() const {
    std::filesystem::create_directory(dir_ / "sparse");
    EXPECT_TRUE(WriteColmapModel(dir_ / "sparse", model).ok());
  }

  std::string Photo(const std::string& name) const { return dir_ / ("images/" + name); }

  // Input with a work folder of its own for every `run`.
  ReconstructInput Input(const std::string& run) const {
    ReconstructInput input;
    input.images_dir = dir_ / "images";
    input.cameras_path = dir_ / "sparse";
    input.work_dir = dir_ / run;
    std::filesystem::create_directory(input.work_dir);
    return input;
  }

  SparseModel model;

 private:
  TempDir dir_;
};

inline ReconstructOptions SmallOptions() {
  ReconstructOptions options;
  options.iterations = kIterations;
  options.holdout_every = 4;  // of 8 photos, 2 and 6
  options.sh_degree = 1;
  options.preview_every = 10;
  options.checkpoint_every = 15;
  options.threads = 1;  // two wait for each other on a busy machine
  options.seed = 11;
  options.recipe = WithPdm(Litags());   // of everything there is
  options.recipe->dense_start = false;  // a cloud has no surfaces
  options.depth_source = DepthOrigin::kNone;
  return options;
}

// Keeps all reports; calls `on_progress`, if there is one, for each.
class Recorder : public ReconstructObserver {
 public:
  void OnProgress(const Progress& progress) override {
    reports.push_back(progress);
    if (on_progress) on_progress(progress);
  }
  void OnSnapshot(const std::string& path) override {
    snapshots.push_back(path);
    EXPECT_TRUE(std::filesystem::exists(path));
  }

  std::vector<Progress> reports;
  std::vector<std::string> snapshots;
  std::function<void(const Progress&)> on_progress;
};

inline absl::StatusOr<ReconstructReport> Reconstruct(const ReconstructInput& input,
                                                     const ReconstructOptions& options) {
  Recorder recorder;
  return MakeEngine(kNoColmap)->Reconstruct(input, options, CancelToken(), &recorder);
}

inline std::string SceneBytes(const ReconstructInput& input) {
  return Bytes(input.work_dir + "/scene.litags");
}

}  // namespace litags

#endif  // LITAGS_ENGINE_PIPELINE_RECONSTRUCT_TEST_UTIL_H_
