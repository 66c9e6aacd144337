#include "engine/train/model.h"

#include <gtest/gtest.h>

#include <algorithm>

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
  for (const bool use_pdm : {true, false}) {
    Model model = SmallModel();
    model.use_pdm = use_pdm;
    ModelRenderer renderer(1);
    Planes direct, channels, alpha, from_channels;
    renderer.RenderColor(model, camera, &direct);
    renderer.RenderChannels(model, camera, &channels, &alpha);
    renderer.Denoise(model, channels, &from_channels);
    EXPECT_EQ(channels.channels, kNumChannels);
    EXPECT_EQ(direct.data, from_channels.data) << "denoiser " << use_pdm;
    const bool changed = !std::equal(direct.data.begin(), direct.data.end(), channels.data.begin());
    EXPECT_EQ(changed, use_pdm) << "the denoiser changes what was composited";
  }
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
