// A scene whose surface is known: a wall, and a blob that only one camera sees.
#ifndef LITAGS_ENGINE_PIPELINE_WALL_TEST_UTIL_H_
#define LITAGS_ENGINE_PIPELINE_WALL_TEST_UTIL_H_

#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "engine/export/export_request.h"
#include "engine/pipeline/model_scene.h"

namespace litags {

inline constexpr double kWallDepth = 5;
inline constexpr float kRedCode = 0.8f, kOtherCode = 0.2f;

inline void AddGaussian(const std::array<double, 3>& mean, const std::array<double, 3>& sigma,
                        const std::array<float, 3>& code, size_t i, Splats* splats) {
  for (int k = 0; k < 3; ++k) {
    splats->at(i, kMean + k) = static_cast<float>(mean[k]);
    splats->at(i, kLogScale + k) = static_cast<float>(std::log(sigma[k]));
    splats->at(i, kShDc + k) = static_cast<float>((code[k] - 0.5) / kSh0);
  }
  splats->at(i, kRawQuat) = 1;
  splats->at(i, kLogitOpacity) = 5;
}

// A red wall 5 units in front of three cameras, and a blue blob that only the first one sees.
inline Model WallModel() {
  constexpr int kColumns = 80, kRows = 50;
  constexpr double kSpacing = 0.12;
  Model model;
  model.lita = model.use_pdm = false;
  model.splats = Splats(kColumns * kRows + 1);
  for (int y = 0; y < kRows; ++y) {
    for (int x = 0; x < kColumns; ++x) {
      AddGaussian({kSpacing * (x - kColumns / 2), kSpacing * (y - kRows / 2), kWallDepth},
                  {0.09, 0.09, 0.003}, {kRedCode, kOtherCode, kOtherCode}, size_t(y) * kColumns + x,
                  &model.splats);
    }
  }
  AddGaussian({-1.9, 0, 1.5}, {0.08, 0.08, 0.08}, {kOtherCode, kOtherCode, kRedCode},
              kColumns * kRows, &model.splats);
  return model;
}

inline std::vector<View> WallViews() {
  std::vector<View> views;
  for (int v = 0; v < 3; ++v) {
    Camera camera;
    camera.width = 96;
    camera.height = 64;
    camera.fx = camera.fy = 60;
    camera.cx = 48;
    camera.cy = 32;
    camera.t[0] = 1 - v;  // centres at -1, 0 and 1
    views.push_back({"photo" + std::to_string(v) + ".png", camera});
  }
  return views;
}

inline std::shared_ptr<const Scene> WallScene() { return MakeScene(WallModel(), WallViews()); }

inline ExportRequest RequestOf(SceneFormat format) {
  ExportRequest request;
  request.format = format;
  return request;
}

}  // namespace litags

#endif  // LITAGS_ENGINE_PIPELINE_WALL_TEST_UTIL_H_
