#include "engine/train/model.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
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
    Planes direct, channels, alpha, from_channels;
    renderer.RenderColor(model, camera, &direct);
    renderer.RenderChannels(model, camera, &channels, &alpha);
    renderer.Denoise(model, channels, &from_channels);
    EXPECT_EQ(channels.channels, use_pdm ? int{kNumChannels} : kWithoutNoise);
    EXPECT_EQ(direct.data, from_channels.data);
    const bool changed = !std::equal(direct.data.begin(), direct.data.end(), channels.data.begin());
    EXPECT_EQ(changed, use_pdm || filter) << "both change what was composited";
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
  Planes channels, alpha, from_channels;
  renderer.RenderChannels(model, camera, &channels, &alpha);
  renderer.Denoise(model, channels, &from_channels);
  EXPECT_EQ(from_channels.data, after.data);
}

TEST(ModelRenderer, A3dgsModelIsNotDenoisedAndHasDepth) {
  Model model = SmallModel();
  model.lita = false;
  const Camera camera = RingCamera(1, 5, 40, 30);
  ModelRenderer renderer(1);
  Planes color, channels, alpha;
  renderer.RenderColor(model, camera, &color);
  renderer.RenderChannels(model, camera, &channels, &alpha);
  ASSERT_EQ(channels.channels, kNumChannels);
  EXPECT_TRUE(std::equal(color.data.begin(), color.data.end(), channels.data.begin()));
  const float* depth = channels.plane(kChannelDepth);
  EXPECT_GT(*std::max_element(depth, depth + channels.plane_size()), 2);
}

}  // namespace
}  // namespace litags
