// A small capture of the sample room with known cameras and points, for tests of whole jobs on
// odd photos.
#ifndef LITAGS_ENGINE_PIPELINE_CAPTURE_TEST_UTIL_H_
#define LITAGS_ENGINE_PIPELINE_CAPTURE_TEST_UTIL_H_

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "engine/core/temp_dir_test_util.h"
#include "engine/io/colmap_io.h"
#include "engine/pipeline/engine.h"
#include "engine/pipeline/reconstruct_test_util.h"
#include "engine/pipeline/train_set.h"
#include "engine/sample/capture.h"
#include "engine/sample/exposure.h"
#include "engine/sample/tracer.h"
#include "engine/sample/world.h"

namespace litags {

enum class Light { kLow, kNormal, kOver };

class RoomCapture {
 public:
  static constexpr int kWidth = 64, kHeight = 48;

  // Views whose index is in `portrait` are taken with the camera turned upright.
  explicit RoomCapture(int views, const std::set<int>& portrait = {})
      : world_(sample::MakeRoom(0)) {
    options_.width = kWidth;
    options_.height = kHeight;
    options_.views = views;
    std::vector<View> cameras = sample::CaptureViews(options_);
    for (int i = 0; i < views; ++i) {
      Camera& camera = cameras[i].camera;
      cameras[i].name = Name(i);
      if (portrait.contains(i)) {
        std::swap(camera.width, camera.height);
        std::swap(camera.cx, camera.cy);
      }
      light_.push_back(sample::TraceRadiance(world_, camera, {.grid = 1, .seed = uint64_t(i)}));
      model.views.push_back(cameras[i]);
      model.distortions.emplace_back();
    }
    exposures_ = sample::SolveExposures(options_, {}, &light_);
    AddPoints();
    std::filesystem::create_directory(dir_ / "images");
    SetLight([](int) { return Light::kLow; });
  }

  static std::string Name(int i) {
    return (i < 10 ? "v00" : i < 100 ? "v0" : "v") + std::to_string(i) + ".png";
  }

  int views() const { return options_.views; }
  std::string Path(const std::string& name) const { return dir_ / name; }

  // [1, H, W], along the optical axis.
  Planes Depth(int i) const { return sample::TraceDepth(world_, model.views[i].camera, 1); }

  ImageU8 Photo(int i, Light light) const {
    if (light == Light::kNormal) return sample::NormalPhoto(light_[i]);
    return light == Light::kLow ? sample::LowPhoto(options_, exposures_, light_[i], i)
                                : sample::OverPhoto(options_, exposures_, light_[i], i);
  }

  template <class LightOf>
  void SetLight(const LightOf& light_of) {
    for (int i = 0; i < views(); ++i) SetPhoto(i, Photo(i, light_of(i)));
  }

  // Every point is on the track of every view that it is not hidden from.
  void TrackPointsEverywhere() {
    for (SparsePoint& point : model.points) point.track.clear();
    for (int v = 0; v < views(); ++v) {
      const Camera& camera = model.views[v].camera;
      const Planes depth = Depth(v);
      for (SparsePoint& point : model.points) {
        const auto xyz = camera.CamFromWorld(point.xyz);
        const double x = camera.fx * xyz[0] / xyz[2] + camera.cx;
        const double y = camera.fy * xyz[1] / xyz[2] + camera.cy;
        if (xyz[2] <= 0 || x < 0 || y < 0 || x >= camera.width || y >= camera.height) continue;
        const double seen = depth.at(0, static_cast<int>(y), static_cast<int>(x));
        if (std::abs(seen / xyz[2] - 1) < 0.03) point.track.push_back({v, x, y});
      }
    }
    std::erase_if(model.points, [](const SparsePoint& point) { return point.track.size() < 2; });
  }

  // By the light of a lamp at the camera, half as bright as would be right on the table.
  void LightByLamp() const {
    for (int i = 0; i < views(); ++i) {
      const Planes lamp = sample::LampLight(model.views[i].camera, Depth(i));
      SetPhoto(i, sample::NormalPhoto(sample::Lit(light_[i], lamp), 2));
    }
  }

  void SetPhoto(int i, const ImageU8& photo) const {
    EXPECT_TRUE(WritePng(dir_ / ("images/" + Name(i)), photo).ok());
  }

  // Writes the cameras and points as a COLMAP model.
  ReconstructInput Input(const std::string& run) const {
    ReconstructInput input;
    input.images_dir = dir_ / "images";
    input.cameras_path = dir_ / "sparse";
    input.work_dir = dir_ / run;
    std::filesystem::create_directory(input.cameras_path);
    std::filesystem::create_directory(input.work_dir);
    EXPECT_TRUE(WriteColmapModel(input.cameras_path, model).ok());
    return input;
  }

  // Every photo the same number of times, about.
  ReconstructOptions Options(int iterations) const {
    ReconstructOptions options;
    options.iterations = iterations;
    options.threads = 1;
    options.sh_degree = 1;
    options.recipe = WithPdm(Litags());  // of everything there is
    options.recipe->pdm.hidden = 2;
    return options;
  }

  TrainSet Load(const ReconstructOptions& options) const {
    ReconstructReport report;
    const ReconstructInput input = Input("work");
    const CancelToken never;
    auto set = MakeTrainSet(Context(
                                input, options, never, [](Stage, const std::string&) {}, &report),
                            kNoColmap);
    EXPECT_TRUE(set.ok()) << set.status();
    return set.ok() ? *std::move(set) : TrainSet();
  }

  SparseModel model;

 private:
  // Every sixth pixel's surface point, from up to six views.
  void AddPoints() {
    const int step = std::max(1, views() / 6);
    for (int v = 0; v < views(); v += step) {
      const Camera& camera = model.views[v].camera;
      const Planes depth = Depth(v);
      const ImageU8 photo = sample::NormalPhoto(light_[v]);
      for (int y = 3; y < camera.height; y += 6) {
        for (int x = 3; x < camera.width; x += 6) {
          SparsePoint point;
          const double z = depth.at(0, y, x);
          const double cam[3] = {(x + 0.5 - camera.cx) / camera.fx * z - camera.t[0],
                                 (y + 0.5 - camera.cy) / camera.fy * z - camera.t[1],
                                 z - camera.t[2]};
          for (int k = 0; k < 3; ++k) {  // R^T (x_cam - t)
            for (int j = 0; j < 3; ++j) point.xyz[k] += camera.R[3 * j + k] * cam[j];
          }
          std::copy_n(photo.pixel(x, y), 3, point.rgb.begin());
          point.track = {{v, x + 0.5, y + 0.5}, {(v + 1) % views(), x + 0.5, y + 0.5}};
          model.points.push_back(std::move(point));
        }
      }
    }
  }

  sample::CaptureOptions options_;
  sample::World world_;
  std::vector<Planes> light_;
  sample::Exposures exposures_;
  TempDir dir_;
};

// Trains without COLMAP, and cancels at an iteration if one is given.
inline absl::StatusOr<ReconstructReport> Train(const ReconstructInput& input,
                                               const ReconstructOptions& options,
                                               int cancel_at = -1) {
  CancelToken cancel;
  Recorder recorder;
  recorder.on_progress = [&](const Progress& progress) {
    if (cancel_at >= 0 && progress.iteration >= cancel_at) cancel.Cancel();
  };
  return MakeEngine(kNoColmap)->Reconstruct(input, options, cancel, &recorder);
}

}  // namespace litags

#endif  // LITAGS_ENGINE_PIPELINE_CAPTURE_TEST_UTIL_H_
