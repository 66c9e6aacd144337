#include "engine/train/model.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "engine/core/peak_memory_test_util.h"
#include "engine/train/train_test_util.h"

namespace litags {
namespace {

Model SmallModel() {
  Model model;
  model.splats = ColoredCloud(60, 5);
  model.pdm = PdmWeights::Initial(model.pdm_options, 3);
  return model;
}

TEST(ModelRenderer, ColourComesOutTheSameWithAndWithoutTheOtherChannels) {
  const Camera camera = RingCamera(1, 5, 40, 30);
  for (const auto& [use_pdm, filter] :
       {std::pair(true, false), {false, false}, {true, true}, {false, true}}) {
    SCOPED_TRACE(absl::StrCat("denoiser ", use_pdm, ", filter ", filter));
    Model model = SmallModel();
    model.use_pdm = use_pdm;
    if (filter) model.noise.emplace().fill(0.05f);
    ModelRenderer renderer(1);
    Planes direct, both, composited, light;
    renderer.RenderColor(model, camera, &direct);
    renderer.RenderColorAndLight(model, camera, &both);
    renderer.RenderChannels(model, camera, kChannelColor, 3, &composited);
    renderer.RenderChannels(model, camera, kChannelIllumination, 3, &light);
    ASSERT_EQ(both.channels, 6);
    EXPECT_TRUE(std::equal(direct.data.begin(), direct.data.end(), both.plane(0)));
    EXPECT_TRUE(std::equal(light.data.begin(), light.data.end(), both.plane(3)));
    EXPECT_EQ(direct.data != composited.data, use_pdm || filter)
        << "both change what was composited";
  }
}

TEST(ModelRenderer, PicturesGoThroughTheCurveLast) {
  const Camera camera = RingCamera(1, 5, 40, 30);
  Model model = SmallModel();
  model.noise.emplace().fill(0.05f);
  ModelRenderer renderer(1);
  Planes before, after;
  renderer.RenderColor(model, camera, &before);
  model.curve.emplace();
  for (size_t i = 0; i < model.curve->size(); ++i) (*model.curve)[i] = 1 - 0.5f * i / 255;
  renderer.RenderColor(model, camera, &after);
  ASSERT_EQ(before.data.size(), after.data.size());
  for (size_t i = 0; i < before.data.size(); ++i) {
    EXPECT_NEAR(after.data[i], 1 - 0.5f * std::clamp(before.data[i], 0.0f, 1.0f), 1e-6f);
  }
  Planes both;
  renderer.RenderColorAndLight(model, camera, &both);
  EXPECT_TRUE(std::equal(after.data.begin(), after.data.end(), both.data.begin()));
}

TEST(ModelRenderer, A3dgsModelIsNotDenoisedAndHasDepth) {
  Model model = SmallModel();
  model.lita = false;
  const Camera camera = RingCamera(1, 5, 40, 30);
  ModelRenderer renderer(1);
  Planes color, composited, depth;
  renderer.RenderColor(model, camera, &color);
  renderer.RenderChannels(model, camera, kChannelColor, 3, &composited);
  EXPECT_EQ(color.data, composited.data);
  renderer.RenderChannels(model, camera, kChannelDepth, 1, &depth);
  EXPECT_GT(*std::max_element(depth.data.begin(), depth.data.end()), 2);
}

// Each of them covers the whole picture: at once their lists would take 1.5 GB.
TEST(ModelRenderer, WhatAPictureTakesIsBoundedHoweverCloseItIs) {
  Model model;
  model.splats = Splats(2000);
  for (size_t i = 0; i < model.splats.size(); ++i) {
    model.splats.at(i, kMean + 2) = 4 + 0.001f * i;
    model.splats.at(i, kRawQuat) = 1;
    model.splats.at(i, kLogitOpacity) = 5;
  }
  Camera camera;
  camera.width = camera.height = 2048;
  camera.fx = camera.fy = 1e7;
  camera.cx = camera.cy = 1024;
  Planes alpha;
  const auto peak = PeakMemoryOf([&] { ModelRenderer(1).RenderAlpha(model, camera, &alpha); });
  if (!peak.has_value()) GTEST_SKIP() << "the peak cannot be reset";
  EXPECT_GT(*std::min_element(alpha.data.begin(), alpha.data.end()), 0.9f);
  EXPECT_LT(*peak, 400 << 20);
}

TEST(ModelRenderer, PlanesThatNobodyWantsTakeNoMemory) {
  Model model = SmallModel();
  model.use_pdm = false;
  const Camera camera = RingCamera(1, 5, 2048, 2048);
  Planes planes;
  const auto one = PeakMemoryOf(
      [&] { ModelRenderer(1).RenderChannels(model, camera, kChannelStructure, 1, &planes); });
  planes = Planes();
  const auto six =
      PeakMemoryOf([&] { ModelRenderer(1).RenderColorAndLight(model, camera, &planes); });
  if (!one.has_value() || !six.has_value()) GTEST_SKIP() << "the peak cannot be reset";
  constexpr int64_t kPlane = 16 << 20;
  EXPECT_LT(*one, 5 * kPlane);
  EXPECT_LT(*six, 10 * kPlane);
}

}  // namespace
}  // namespace litags
