// Masks in the objective: what is under them changes nothing and teaches nothing.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "engine/core/mask.h"
#include "engine/target/information.h"
#include "engine/train/objective.h"
#include "engine/train/objective_test_util.h"

namespace litags {
namespace {

constexpr int kWidth = 48, kHeight = 20, kIteration = 8;
constexpr int kFirstMasked = 22;  // column; all to its right is masked

bool Masked(size_t pixel) { return pixel % kWidth >= kFirstMasked; }

TrainView MaskedView() {
  TrainView view = RandomView(kWidth, kHeight);
  view.mask = PlaneU8(kWidth, kHeight);
  for (size_t i = 0; i < view.mask.data.size(); ++i) view.mask.data[i] = Masked(i) ? 0 : kCounts;
  // What the pipeline does with depth maps.
  ForMasked(view.mask,
            [&](size_t i) { view.depth->depth.data[i] = view.depth->confidence.data[i] = 0; });
  return view;
}

// Other photo, target, structure and information where `masked` says so.
TrainView WithOtherPixels(TrainView view, bool masked) {
  const CounterRng rng(5, 5);
  for (size_t i = 0; i < view.mask.data.size(); ++i) {
    if (Masked(i) != masked) continue;
    for (int c = 0; c < 3; ++c) {
      view.photo.data[3 * i + c] = PhotoSample(rng.Below(6 * i + c, 256) / 255.0f);
      view.target.data[3 * i + c] = PhotoSample(rng.Below(6 * i + 3 + c, 256) / 255.0f);
    }
    view.structure.data[i] ^= 0x5a;
    if (!view.information.empty()) view.information.data[i] ^= 0x5a;
  }
  return view;
}

TrainOptions Options(bool pdm) {
  TrainOptions options;
  options.threads = 1;
  options.recipe.use_pdm = pdm;
  options.recipe.pdm.hidden = 4;
  options.recipe.pdm_every = 1;
  return options;
}

TrainOptions PlainOptions() {
  TrainOptions options;
  options.threads = 1;
  options.recipe.lita = false;
  options.recipe.use_pdm = false;
  return options;
}

struct Result {
  StepLosses losses;
  Planes v_rendered;
  PdmWeights v_weights;
};

Result Evaluate(const TrainOptions& options, const TrainView& view, const Planes& rendered) {
  const PdmWeights weights =
      options.recipe.use_pdm ? PdmWeights::Initial(options.recipe.pdm, 3) : PdmWeights();
  Objective objective(options);
  Result result;
  result.losses = objective.Evaluate(view, rendered, weights, kIteration, options.recipe.use_pdm,
                                     &result.v_rendered, &result.v_weights);
  return result;
}

bool SameBytes(const Result& a, const Result& b) {
  return a.losses.Total() == b.losses.Total() && a.v_rendered.data == b.v_rendered.data &&
         a.v_weights.nets == b.v_weights.nets;
}

Planes Rendered(const TrainOptions& options) {
  return RandomPlanes(Objective(options).NumChannels(), kHeight, kWidth, 12);
}

TEST(MaskedObjective, WhatIsUnderTheMaskChangesNoByte) {
  for (const TrainOptions& options : {Options(false), Options(true), PlainOptions()}) {
    SCOPED_TRACE(testing::Message() << options.recipe.lita << options.recipe.use_pdm);
    TrainView view = MaskedView();
    view.information = PlaneU8(kWidth, kHeight);
    std::fill(view.information.data.begin(), view.information.data.end(), kInformationOne / 2);
    const Planes rendered = Rendered(options);
    const Result result = Evaluate(options, view, rendered);
    EXPECT_TRUE(SameBytes(Evaluate(options, WithOtherPixels(view, true), rendered), result));
    EXPECT_FALSE(SameBytes(Evaluate(options, WithOtherPixels(view, false), rendered), result));
  }
}

TEST(MaskedObjective, AMaskInWhichAllPixelsCountChangesNoByte) {
  for (const TrainOptions& options : {Options(false), Options(true), PlainOptions()}) {
    TrainView view = RandomView(kWidth, kHeight);
    const Planes rendered = Rendered(options);
    const Result without = Evaluate(options, view, rendered);
    view.mask = PlaneU8(kWidth, kHeight);
    std::fill(view.mask.data.begin(), view.mask.data.end(), kCounts);
    EXPECT_TRUE(SameBytes(Evaluate(options, view, rendered), without));
  }
}

TEST(MaskedObjective, MaskedPixelsPassOnNoGradient) {
  for (const TrainOptions& options : {Options(false), PlainOptions()}) {
    const Result result = Evaluate(options, MaskedView(), Rendered(options));
    double counted = 0;
    for (int c = 0; c < result.v_rendered.channels; ++c) {
      for (size_t i = 0; i < result.v_rendered.plane_size(); ++i) {
        const float v = result.v_rendered.plane(c)[i];
        if (Masked(i)) {
          ASSERT_EQ(v, 0) << "channel " << c << " pixel " << i;
        }
        counted += std::abs(v);
      }
    }
    EXPECT_GT(counted, 0);
  }
}

// The denoised colour of a pixel that counts is made of rendered colours around it, masked or not.
TEST(MaskedObjective, WithTheDenoiserMaskedPixelsBeyondItsReachPassOnNoGradient) {
  const TrainOptions options = Options(true);
  // Each stage: three convolutions of 3x3 over what a filter of 3x3 takes from the picture.
  const int reach = options.recipe.pdm.stages * 4;
  ASSERT_LT(kFirstMasked + reach, kWidth);
  const Result result = Evaluate(options, MaskedView(), Rendered(options));
  double near = 0;
  for (int c = 0; c < result.v_rendered.channels; ++c) {
    const bool denoised = c < 3 || (c >= kChannelNoise && c < kChannelNoise + 3);
    for (size_t i = 0; i < result.v_rendered.plane_size(); ++i) {
      const float v = result.v_rendered.plane(c)[i];
      const bool beyond = i % kWidth >= size_t(kFirstMasked + reach);
      if (Masked(i) && (beyond || !denoised)) {
        ASSERT_EQ(v, 0) << c << " " << i;
      }
      if (Masked(i) && denoised) near += std::abs(v);
    }
  }
  EXPECT_GT(near, 0) << "nothing passes through the denoiser: its reach is not tested";
}

// Central differences along the sign of the gradient over patches of pixels that count; masked
// pixels keep their values, so that photo and target keep theirs there.
void CheckDifferences(const TrainOptions& options, const std::vector<int>& channels) {
  constexpr float kStep = 2e-3f;
  constexpr int kSide = 6;
  const TrainView view = MaskedView();
  Planes rendered = RenderedAwayFromKinks(Objective(options).NumChannels(), kWidth, kHeight);
  const Planes v = Evaluate(options, view, rendered).v_rendered;
  for (const int c : channels) {
    double error2 = 0, norm2 = 0;
    for (int sample = 0; sample < 12; ++sample) {
      const CounterRng rng(11, sample);
      // Every other patch touches the mask's border.
      const size_t x = sample % 2 ? kFirstMasked - kSide : rng.Below(0, kFirstMasked - kSide);
      const size_t y = rng.Below(1, kHeight - kSide + 1);
      const Planes kept = rendered;
      double have = 0;
      const auto loss_at = [&](float step) {
        have = 0;
        for (size_t k = 0; k < kSide * kSide; ++k) {
          const size_t i = (y + k / kSide) * kWidth + x + k % kSide;
          have += std::abs(v.plane(c)[i]);
          rendered.plane(c)[i] = kept.plane(c)[i] + std::copysign(step, step * v.plane(c)[i]);
        }
        const double loss = Evaluate(options, view, rendered).losses.Total();
        rendered = kept;
        return loss;
      };
      const double want = (loss_at(kStep) - loss_at(-kStep)) / (2 * kStep);
      error2 += (have - want) * (have - want);
      norm2 += want * want;
    }
    EXPECT_GT(norm2, 0) << c;
    // objective_test.cc has the reasons: rounding of sums in float.
    EXPECT_LE(std::sqrt(error2), 0.02 * std::sqrt(norm2)) << c;
  }
}

TEST(MaskedObjective, GradientsOfPixelsThatCountAreThoseOfDifferences) {
  TrainOptions options = Options(false);
  CheckDifferences(options, {0, 1, 2, kChannelStructure, kChannelDepth, kChannelIllumination,
                             kChannelIllumination + 2});
  CheckDifferences(PlainOptions(), {0, 1, 2});
}

}  // namespace
}  // namespace litags
