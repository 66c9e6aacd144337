#include "engine/train/objective.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "engine/core/simd_test_util.h"
#include "engine/target/information.h"
#include "engine/train/crop.h"
#include "engine/train/loss_test_util.h"
#include "engine/train/objective_test_util.h"
#include "engine/train/train_test_util.h"
#include "gtest/gtest.h"

namespace litags {
namespace {

constexpr int kWidth = 24, kHeight = 20, kIteration = 7;

TrainView SmallView() { return RandomView(kWidth, kHeight); }

// All layers non-zero, so that every weight has a gradient.
PdmWeights RandomWeights(const PdmOptions& options) {
  PdmWeights weights = PdmWeights::Initial(options, 3);
  for (auto& net : weights.nets) {
    for (size_t i = 0; i < net.size(); ++i) {
      net[i] += static_cast<float>(0.05 * CounterRng(4, 4).Normal(i));
    }
  }
  return weights;
}

double TotalLoss(const TrainOptions& options, const TrainView& view, const Planes& rendered,
                 const PdmWeights& weights) {
  Objective objective(options);
  Planes v_rendered;
  PdmWeights v_weights;
  return objective
      .Evaluate(view, rendered, weights, kIteration, objective.Denoises(kIteration), &v_rendered,
                &v_weights)
      .Total();
}

// Central differences of the total loss along directions sign(gradient) over the sets of samples
// that `pick` chooses, against the same sums of `gradient`. One sample would not do: losses add a
// row's pixels in float, so values carry noise of some 3e-8, which over 2 kStep is 7e-6, a tenth
// of one pixel's gradient but 0.3% of that of 36.
void CheckGradient(std::vector<float>* values, const std::vector<float>& gradient,
                   const std::function<std::vector<size_t>(int sample)>& pick,
                   const std::function<double()>& loss, const std::string& name) {
  SCOPED_TRACE(name);
  constexpr float kStep = 2e-3f;  // ReLUs of the denoiser have kinks, too
  const std::vector<float> kept = *values;
  double error2 = 0, norm2 = 0, error = 0, largest = 0;
  for (int sample = 0; sample < 20; ++sample) {
    const std::vector<size_t> chosen = pick(sample);
    const auto loss_at = [&](float step) {
      for (const size_t i : chosen)
        (*values)[i] = kept[i] + std::copysign(step, step * gradient[i]);
      const double value = loss();
      for (const size_t i : chosen) (*values)[i] = kept[i];
      return value;
    };
    const double want = (loss_at(kStep) - loss_at(-kStep)) / (2 * kStep);
    double have = 0;
    for (const size_t i : chosen) have += std::abs(gradient[i]);
    error = std::max(error, std::abs(have - want));
    error2 += (have - want) * (have - want);
    norm2 += want * want;
    largest = std::max(largest, std::abs(want));
  }
  EXPECT_GT(norm2, 0) << "nothing depends on it";
  // Noise as above, and a ReLU that turns within the step in one patch of twenty, by the SIMD
  // target: 0.0204 was seen.
  EXPECT_LE(std::sqrt(error2), 0.03 * std::sqrt(norm2));
  EXPECT_LE(error, 0.06 * largest);
}

void CheckAllGradients(const TrainOptions& options, const std::vector<int>& live_channels,
                       const TrainView& view = SmallView()) {
  Objective objective(options);
  Planes rendered = RenderedAwayFromKinks(objective.NumChannels(), kWidth, kHeight);
  PdmWeights weights;
  if (options.recipe.lita && options.recipe.use_pdm) weights = RandomWeights(options.recipe.pdm);
  Planes v_rendered;
  PdmWeights v_weights;
  objective.Evaluate(view, rendered, weights, kIteration, objective.Denoises(kIteration),
                     &v_rendered, &v_weights);
  ASSERT_EQ(v_rendered.data.size(), rendered.data.size());
  const auto loss = [&] { return TotalLoss(options, view, rendered, weights); };
  const size_t plane = rendered.plane_size();
  for (int c = 0; c < rendered.channels; ++c) {
    const bool live = std::count(live_channels.begin(), live_channels.end(), c) > 0;
    if (live) {
      const auto patch = [&](int sample) {
        constexpr int kSide = 6;
        const CounterRng rng(11, sample);
        const size_t x = rng.Below(0, kWidth - kSide + 1), y = rng.Below(1, kHeight - kSide + 1);
        std::vector<size_t> chosen;
        for (size_t i = 0; i < kSide * kSide; ++i) {
          chosen.push_back(c * plane + (y + i / kSide) * kWidth + x + i % kSide);
        }
        return chosen;
      };
      CheckGradient(&rendered.data, v_rendered.data, patch, loss, "channel " + std::to_string(c));
    } else {
      for (size_t i = 0; i < plane; ++i) ASSERT_EQ(v_rendered.plane(c)[i], 0) << "channel " << c;
    }
  }
  for (size_t k = 0; k < weights.nets.size(); ++k) {
    ASSERT_EQ(v_weights.nets[k].size(), weights.nets[k].size());
    const auto some = [&](int sample) {
      std::vector<size_t> chosen;
      for (size_t i = 0; i < weights.nets[k].size(); ++i) {
        if (CounterRng(12, sample).Below(i, 20) == 0) chosen.push_back(i);
      }
      return chosen;
    };
    CheckGradient(&weights.nets[k], v_weights.nets[k], some, loss, "network " + std::to_string(k));
  }
}

TrainOptions Options() {
  TrainOptions options;
  options.threads = 1;
  options.recipe.pdm.hidden = 4;
  return options;
}

TEST(Objective, GradientOfTheWholeLossAgreesWithDifferences) {
  CheckAllGradients(Options(), {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10});
}

TEST(Objective, GradientAgreesWithOtherWeightsAndOwnNetworks) {
  TrainOptions options = Options();
  options.recipe.pdm.shared = false;
  options.recipe.pdm.stages = 2;
  options.recipe.weight_exposure = 0.3;
  options.recipe.weight_reconstruction = 2;
  options.recipe.weight_prior = 0.7;
  options.recipe.weight_depth = 1.5;
  options.recipe.weight_denoise = 40;
  options.recipe.weight_tv = 3;
  CheckAllGradients(options, {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10});
}

TEST(Objective, GradientAgreesWithASingleStage) {
  TrainOptions options = Options();
  options.recipe.pdm.stages = 1;
  CheckAllGradients(options, {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10});
}

// A weight for each pixel, 0 to 2.
TrainView InformedView() {
  TrainView view = SmallView();
  view.information = PlaneU8(kWidth, kHeight);
  for (size_t i = 0; i < view.information.data.size(); ++i) {
    view.information.data[i] = static_cast<uint8_t>(CounterRng(6, 6).Below(i, 129));
  }
  return view;
}

TEST(Objective, GradientAgreesWithInformationWeights) {
  TrainOptions options = Options();
  options.recipe.exposure_ssim = 0.2;
  CheckAllGradients(options, {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10}, InformedView());
}

// A pixel that other photos know better by far must not spoil SSIM of what is around it.
TEST(Objective, DoubtfulPixelsHaveNoPartInTheWindowsAround) {
  TrainOptions options = Options();
  options.recipe.use_pdm = false;
  options.recipe.exposure_ssim = 0.2;
  const Planes rendered = RandomPlanes(kWithoutNoise, kHeight, kWidth, 9);
  const size_t middle = size_t(kHeight / 2) * kWidth + kWidth / 2;
  const auto gradient = [&](int information, int16_t sample) {
    TrainView view = SmallView();
    view.information = PlaneU8(kWidth, kHeight);
    std::fill(view.information.data.begin(), view.information.data.end(), kInformationOne);
    view.information.data[middle] = static_cast<uint8_t>(information);
    std::fill_n(&view.target.data[3 * middle], 3, sample);
    Planes v_rendered;
    PdmWeights v_weights;
    Objective(options).Evaluate(view, rendered, {}, 0, false, &v_rendered, &v_weights);
    for (int c = 0; c < 3; ++c) v_rendered.plane(c)[middle] = 0;
    return v_rendered.data;
  };
  EXPECT_EQ(gradient(kInformationOne / 8, 0), gradient(kInformationOne / 8, kPhotoWhite));
  EXPECT_NE(gradient(kInformationOne / 2, 0), gradient(kInformationOne / 2, kPhotoWhite));
}

TEST(Objective, InformationWeighsPhotoAndTarget) {
  TrainOptions options = Options();
  options.recipe.use_pdm = false;
  TrainView view = SmallView();
  const Planes rendered = RandomPlanes(kWithoutNoise, kHeight, kWidth, 9);
  const auto evaluate = [&] {
    Planes v_rendered;
    PdmWeights v_weights;
    return Objective(options).Evaluate(view, rendered, {}, 0, false, &v_rendered, &v_weights);
  };
  const StepLosses plain = evaluate();
  view.information = PlaneU8(kWidth, kHeight);
  std::fill(view.information.data.begin(), view.information.data.end(), kInformationOne);
  const StepLosses one = evaluate();
  EXPECT_NEAR(one.exposure, plain.exposure, 1e-6);
  EXPECT_NEAR(one.reconstruction, plain.reconstruction, 1e-6);
  std::fill(view.information.data.begin(), view.information.data.end(), 0);
  const StepLosses none = evaluate();
  EXPECT_LT(none.exposure, plain.exposure);
  EXPECT_LT(none.reconstruction, plain.reconstruction);
  EXPECT_EQ(none.prior, plain.prior);
}

// Cells at the rim have 0.25 to 2.25 times the pixels of the mean one, and losses are means.
TEST(Objective, EveryPixelOfAPhotoHasTheSamePartInItsCrops) {
  constexpr int kSide = 64, kVisits = 16000;
  const CropGrid grid(kSide, kSide, kSide * kSide / 4);
  ASSERT_EQ(grid.cells(), 4);
  TrainOptions options;
  options.recipe = LitagsPaper();
  options.recipe.use_pdm = options.recipe.use_prior = options.recipe.use_depth = false;
  options.recipe.weight_reconstruction = 0;
  TrainView white;
  white.photo = white.target = PhotoFromU8(ImageU8(kSide, kSide));
  std::fill(white.target.data.begin(), white.target.data.end(), kPhotoWhite);
  Objective objective(options);
  std::vector<double> pull(kSide * kSide);
  TrainView cropped;
  for (int visit = 0; visit < kVisits; ++visit) {
    const PixelRect crop = DrawCrop(grid, 1, 0, visit);
    CropView(white, crop, 1, &cropped);
    Planes rendered(kWithoutNoise, crop.height, crop.width), v_rendered;
    objective.Evaluate(cropped, rendered, {}, 0, false, &v_rendered, nullptr, grid.WeightOf(crop));
    for (int y = 0; y < crop.height; ++y) {
      for (int x = 0; x < crop.width; ++x) {
        pull[(crop.y + y) * kSide + crop.x + x] -= v_rendered.at(0, y, x);
      }
    }
  }
  const auto [least, most] = std::minmax_element(pull.begin(), pull.end());
  EXPECT_LT(*most / *least, 1.1);
}

TEST(Objective, WithoutPdmThereIsNoNoise) {
  TrainOptions options = Options();
  options.recipe.use_pdm = false;
  EXPECT_EQ(Objective(options).NumChannels(), int{kChannelNoise});
  CheckAllGradients(options, {0, 1, 2, 3, 4, 5, 6, 7});
}

// What is not denoised has the gradients that all channels would give.
TEST(Objective, WhereNothingIsDenoisedTheNoiseIsNotRendered) {
  Objective objective(Options());
  EXPECT_EQ(objective.Settings(true).num_channels, kNumChannels);
  ASSERT_EQ(objective.Settings(false).num_channels, kWithoutNoise);
  const Splats splats = ColoredCloud(300, 1);
  const TrainView view = SmallView();
  const auto gradients = [&](int channels) {
    RenderSettings settings = objective.Settings(false);
    settings.num_channels = channels;
    Renderer renderer;
    Planes rendered, alpha, v_rendered;
    renderer.Forward(splats, view.view.camera, settings, &rendered, &alpha);
    objective.Evaluate(view, rendered, {}, kIteration, false, &v_rendered, nullptr);
    AlignedFloats all(splats.data().size());
    renderer.Backward(
        splats, v_rendered, Planes(), [&](size_t block, const float* grads, uint32_t) {
          std::copy_n(grads, Splats::kBlockFloats, all.data() + block * Splats::kBlockFloats);
        });
    return all;
  };
  ForEachTarget([&] { EXPECT_TRUE(SameBytes(gradients(kWithoutNoise), gradients(kNumChannels))); });
}

TEST(Objective, WithoutPriorAndDepthTheirChannelsAreFree) {
  TrainOptions options = Options();
  options.recipe.use_prior = false;
  options.recipe.use_depth = false;
  CheckAllGradients(options, {0, 1, 2, 5, 6, 7, 8, 9, 10});
}

TEST(Objective, Plain3dgsComparesColoursWithTheTarget) {
  TrainOptions options = Options();
  options.recipe.lita = false;
  options.recipe.exposure_ssim = 0.2;
  CheckAllGradients(options, {0, 1, 2});
}

TEST(Objective, Plain3dgsHasTheConstantsOfItsRecipe) {
  const TrainView view = SmallView();
  const Planes rendered = RandomPlanes(3, kHeight, kWidth, 9);
  const auto loss = [&](double weight, double ssim) {
    TrainOptions options = Options();
    options.recipe = Plain3dgs();
    options.recipe.weight_exposure *= weight;
    options.recipe.exposure_ssim += ssim;
    return TotalLoss(options, view, rendered, {});
  };
  Planes target;
  LossWorkspace workspace(1);
  UnpackImage(view.target, workspace, &target);
  EXPECT_EQ(loss(1, 0), ReconstructionLoss(rendered, target, 1, {}, workspace)) << "3DGS Eq. 7";
  EXPECT_DOUBLE_EQ(loss(2, 0), 2 * loss(1, 0));
  EXPECT_DOUBLE_EQ(loss(1, 0.8), SsimLoss(rendered, target, 1, {}, workspace));
  EXPECT_DOUBLE_EQ(loss(1, -0.2), L1Loss(rendered, target, 1, {}, workspace));
}

TEST(Objective, TermsAreWeightedAndSumToTheTotal) {
  const TrainView view = SmallView();
  const Planes rendered = RandomPlanes(kNumChannels, kHeight, kWidth, 9);
  TrainOptions options = Options();
  const PdmWeights weights = RandomWeights(options.recipe.pdm);
  Planes v_rendered;
  PdmWeights v_weights;
  const StepLosses one = Objective(options).Evaluate(
      view, rendered, weights, 0, options.recipe.use_pdm, &v_rendered, &v_weights);
  for (const double term : {one.exposure, one.reconstruction, one.prior, one.depth, one.denoise}) {
    EXPECT_GT(term, 0);
  }
  options.recipe.weight_exposure *= 2;
  options.recipe.weight_prior *= 3;
  options.recipe.weight_depth *= 5;
  const StepLosses two = Objective(options).Evaluate(
      view, rendered, weights, 0, options.recipe.use_pdm, &v_rendered, &v_weights);
  EXPECT_DOUBLE_EQ(two.exposure, 2 * one.exposure);
  EXPECT_DOUBLE_EQ(two.prior, 3 * one.prior);
  EXPECT_DOUBLE_EQ(two.depth, 5 * one.depth);
  EXPECT_DOUBLE_EQ(two.reconstruction, one.reconstruction);
  EXPECT_DOUBLE_EQ(two.Total(),
                   two.exposure + two.reconstruction + two.prior + two.depth + two.denoise);
}

TEST(Objective, ASmallDepthMapCountsAsEnlarged) {
  TrainView small = SmallView(), large = SmallView();
  small.depth = DepthMap{RandomPlanes(1, kHeight / 2, kWidth / 3, 3),
                         RandomPlanes(1, kHeight / 2, kWidth / 3, 4)};
  ResizeDepth(*small.depth, kWidth, kHeight, 1, &*large.depth);
  Planes gradients[2];
  double losses[2];
  for (int i = 0; i < 2; ++i) {
    PdmWeights v_weights;
    losses[i] =
        Objective(Options())
            .Evaluate(i == 0 ? small : large, RandomPlanes(kNumChannels, kHeight, kWidth, 9),
                      RandomWeights(Options().recipe.pdm), 0, true, &gradients[i], &v_weights)
            .depth;
  }
  EXPECT_GT(losses[0], 0);
  EXPECT_EQ(losses[0], losses[1]);
  EXPECT_EQ(gradients[0].data, gradients[1].data);
}

TEST(Objective, AViewWithoutMapsTrainsWithoutTheirTerms) {
  TrainView view = SmallView();
  view.structure = PlaneU8();
  view.depth.reset();
  const TrainOptions options = Options();
  Planes v_rendered;
  PdmWeights v_weights;
  const StepLosses losses = Objective(options).Evaluate(
      view, RandomPlanes(kNumChannels, kHeight, kWidth, 9), RandomWeights(options.recipe.pdm), 0,
      true, &v_rendered, &v_weights);
  EXPECT_EQ(losses.prior, 0);
  EXPECT_EQ(losses.depth, 0);
  EXPECT_GT(losses.denoise, 0);
}

}  // namespace
}  // namespace litags
