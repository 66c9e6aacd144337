// A small scene and its pictures, for tests of scenes and their files.
#ifndef LITAGS_ENGINE_PIPELINE_SCENE_TEST_UTIL_H_
#define LITAGS_ENGINE_PIPELINE_SCENE_TEST_UTIL_H_

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "engine/io/test_util.h"
#include "engine/pipeline/scene.h"
#include "engine/train/model.h"
#include "engine/train/train_test_util.h"

namespace litags {

inline constexpr int kWidth = 40, kHeight = 24;

// 37 Gaussians: not a multiple of a block.
inline Model SmallModel(bool lita = true) {
  Model model;
  model.splats = ColoredCloud(37, 5);
  model.lita = lita;
  model.use_pdm = lita;
  model.sh_degree = 2;
  model.iteration = 1234;
  model.pdm_options.stages = 2;
  model.pdm_options.hidden = 4;
  model.pdm_options.shared = false;
  model.pdm_options.border = PdmBorder::kZero;
  model.pdm = PdmWeights::Initial(model.pdm_options, 9);
  // The last layer starts at zero, and then no weight matters.
  for (auto& net : model.pdm.nets) {
    for (size_t i = PdmNetLayout(4).w3; i < net.size(); ++i) net[i] = 0.01f * (i % 7) - 0.02f;
  }
  model.pixel_filter = PixelFilter::kMip;
  if (lita) {
    model.noise.emplace();
    for (size_t i = 0; i < model.noise->size(); ++i) (*model.noise)[i] = 0.3f / (3 + i);
    model.curve.emplace();
    for (size_t i = 0; i < model.curve->size(); ++i) (*model.curve)[i] = i * i / (255.0f * 255);
  }
  return model;
}

inline std::vector<View> RingViews(int count) {
  std::vector<View> views;
  for (int i = 0; i < count; ++i) {
    views.push_back({"photo" + std::to_string(i) + ".png", RingCamera(i, count, kWidth, kHeight)});
  }
  return views;
}

inline std::string FullPly(const Scene& scene, const std::string& path) {
  EXPECT_TRUE(scene.ExportFullPly(path).ok());
  return Bytes(path);
}

inline absl::StatusOr<Planes> RenderChannel(const Scene& scene, Channel channel, double light = 0,
                                            double stops = 0) {
  RenderRequest request;
  request.camera = RingCamera(1, 5, kWidth, kHeight);
  request.channel = channel;
  request.light = light;
  request.exposure_stops = stops;
  request.threads = 1;
  return scene.Render(request);
}

}  // namespace litags

#endif  // LITAGS_ENGINE_PIPELINE_SCENE_TEST_UTIL_H_
