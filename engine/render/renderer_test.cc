#include "engine/render/renderer.h"

#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <numeric>
#include <string>
#include <utility>

#include "engine/core/rng.h"
#include "engine/core/simd_test_util.h"
#include "engine/render/constants.h"
#include "engine/render/reference_renderer.h"
#include "engine/render/renderer_test_util.h"
#include "gtest/gtest.h"

namespace litags {
namespace {

void ExpectMatchesReference(const Splats& splats, const Camera& camera,
                            const RenderSettings& settings) {
  const ReferenceImage want = RenderReference(ToDoubles(splats), camera, settings);
  Renderer renderer;
  Planes image, alpha;
  renderer.Forward(splats, camera, settings, &image, &alpha);
  ASSERT_EQ(image.data.size(), want.image.size());
  const size_t plane = image.plane_size();
  size_t fragile = 0;
  double worst = 0;
  for (size_t i = 0; i < plane; ++i) {
    if (want.fragile[i]) {
      ++fragile;
      continue;
    }
    worst = std::max(worst, std::abs(alpha.data[i] - want.alpha[i]));
    for (int c = 0; c < settings.num_channels; ++c) {
      // Depth is in scene units up to ~5; everything else is of order 1.
      const double scale = c == kChannelDepth ? 5 : 1;
      worst =
          std::max(worst, std::abs(image.data[c * plane + i] - want.image[c * plane + i]) / scale);
    }
  }
  EXPECT_LT(worst, 2e-5) << "single precision reaches 2e-6 on most scenes, 1e-5 on degenerate ones";
  EXPECT_LE(fragile, plane / 4 + 1);
}

TEST(Renderer, ThresholdsOfAlphaAreOneNumber) {
  EXPECT_FLOAT_EQ(kLog2AlphaMin, std::log2(kAlphaMin));
}

TEST(Renderer, MatchesTheReferenceOnEveryTargetAndOddSizes) {
  ForEachTarget([] {
    for (const auto& [w, h] : {std::pair{61, 43}, {16, 16}, {1, 1}, {17, 5}, {3, 33}}) {
      SCOPED_TRACE(std::to_string(w) + "x" + std::to_string(h));
      for (int channels : {kColorOnly, kWithoutNoise, int{kNumChannels}}) {
        RenderSettings settings;
        settings.num_channels = channels;
        settings.background[0] = 0.3f;
        settings.depth_source = DepthSource::kCameraZ;
        for (size_t n : {size_t{1}, size_t{17}, size_t{150}}) {
          ExpectMatchesReference(MakeSplats(n, n), MakeCamera(w, h), settings);
        }
      }
    }
  });
}

// A whole block of the same one, as Gaussians out of sight are left out by the vector.
Splats BlockOf(double log_scale, bool needle, const std::array<double, 3>& mean, uint64_t seed) {
  Splats splats(kSplatBlock);
  const Splats shape = MakeSplats(1, seed);
  for (size_t i = 0; i < splats.size(); ++i) {
    for (int row = 0; row < kSplatRows; ++row) splats.at(i, row) = shape.at(0, row);
    for (int k = 0; k < 3; ++k) splats.at(i, kMean + k) = mean[k];
    for (int k = 0; k < 3; ++k) splats.at(i, kLogScale + k) = needle && k < 2 ? -4 : log_scale;
    splats.at(i, kLogitOpacity) = 9;
  }
  return splats;
}

TEST(Renderer, AGaussianIsSeenWhoseRimAloneReachesThePicture) {
  const Camera camera = MakeCamera(80, 60);
  const CounterRng rng(11, 3);
  RenderSettings settings;
  settings.num_channels = kColorOnly;
  Renderer renderer;
  Planes image, alpha;
  int seen_from_outside = 0;
  for (uint64_t i = 0; i < 1000; ++i) {
    const auto normal = [&](int k) { return rng.Normal(4 * i + k); };
    const std::array<double, 3> mean = {4 * normal(0), 4 * normal(1), 4 * normal(2)};
    const Splats splats = BlockOf(normal(3) - 0.5, i % 2 == 0, mean, i);
    settings.pixel_filter = i % 4 < 2 ? PixelFilter::kMip : PixelFilter::kDilate;
    const ReferenceImage want = RenderReference(ToDoubles(splats), camera, settings);
    renderer.Forward(splats, camera, settings, &image, &alpha);
    for (size_t k = 0; k < alpha.data.size(); ++k) {
      if (want.fragile[k]) continue;
      ASSERT_NEAR(alpha.data[k], want.alpha[k], 1e-3) << i << " " << k;
    }
    const auto p = camera.CamFromWorld(mean);
    const double x = camera.fx * p[0] / p[2] + camera.cx, y = camera.fy * p[1] / p[2] + camera.cy;
    const bool inside = x >= 0 && x <= camera.width && y >= 0 && y <= camera.height;
    seen_from_outside += !inside && want.contributions > 0;
  }
  EXPECT_GT(seen_from_outside, 100);
}

TEST(Renderer, ACropHasThePixelsOfTheWholeImage) {
  const Splats splats = MakeSplats(200, 5);
  const Camera camera = MakeCamera(90, 70);
  RenderSettings settings;
  Renderer renderer;
  Planes whole, part, alpha;
  renderer.Forward(splats, camera, settings, &whole, &alpha);
  for (const PixelRect crop : {PixelRect{0, 0, 90, 70}, {37, 21, 40, 33}, {80, 60, 10, 10}}) {
    settings.crop = crop;
    renderer.Forward(splats, camera, settings, &part, &alpha);
    ASSERT_EQ(part.width, crop.width);
    ASSERT_EQ(part.height, crop.height);
    double sum = 0;
    for (int c = 0; c < kNumChannels; ++c) {
      for (int y = 0; y < crop.height; ++y) {
        for (int x = 0; x < crop.width; ++x) {
          const float want = whole.at(c, crop.y + y, crop.x + x);
          // A pixel at a Gaussian's edge of 1/255 may round to its other side.
          ASSERT_NEAR(part.at(c, y, x), want, 0.02) << c << " " << x << " " << y;
          sum += std::abs(part.at(c, y, x) - want);
        }
      }
    }
    EXPECT_LT(sum / (kNumChannels * crop.width * crop.height), 2e-5);
  }
}

// The same splats with every scale times `factor`.
Splats Resized(Splats splats, double factor) {
  for (size_t i = 0; i < splats.size(); ++i) {
    for (int k = 0; k < 3; ++k) splats.at(i, kLogScale + k) += std::log(factor);
  }
  return splats;
}

TEST(Renderer, MipFilterMatchesTheReferenceOnEveryTarget) {
  ForEachTarget([] {
    RenderSettings settings;
    settings.pixel_filter = PixelFilter::kMip;
    settings.background[1] = 0.6f;
    for (const double factor : {0.03, 0.2, 1.0}) {  // from a hundredth of a pixel on
      SCOPED_TRACE(factor);
      const Splats splats = Resized(MakeSplats(300, 4), factor);
      for (const int channels : {kColorOnly, int{kNumChannels}}) {
        settings.num_channels = channels;
        ExpectMatchesReference(splats, MakeCamera(61, 43), settings);
      }
      settings.num_channels = kColorOnly;
      settings.dropout = {0.4, CounterRng(1, 2)};
      ExpectMatchesReference(splats, MakeCamera(61, 43), settings);
      settings.dropout = {};
    }
  });
}

// Mean opacity of a picture of `width` px.
double Covered(const Splats& splats, int width, PixelFilter filter) {
  RenderSettings settings;
  settings.num_channels = kColorOnly;
  settings.pixel_filter = filter;
  Planes image, alpha;
  Renderer().Forward(splats, MakeCamera(width, width * 3 / 4), settings, &image, &alpha);
  return std::accumulate(alpha.data.begin(), alpha.data.end(), 0.0) / alpha.data.size();
}

// What small Gaussians cover of a picture does not depend on its size, as it does if they only
// grow.
TEST(Renderer, MipFilterCoversAsMuchOfSmallPicturesAsOfLargeOnes) {
  Splats splats = Resized(MakeSplats(400, 8), 0.2);  // 0.4 px in the smallest picture
  for (size_t i = 0; i < splats.size(); ++i) splats.at(i, kLogitOpacity) = 1;
  const double want = Covered(splats, 1600, PixelFilter::kMip);
  EXPECT_NEAR(Covered(splats, 1600, PixelFilter::kDilate), want, 0.05 * want);
  for (const int width : {400, 200, 100}) {
    EXPECT_NEAR(Covered(splats, width, PixelFilter::kMip), want, 0.05 * want) << width;
  }
  EXPECT_GT(Covered(splats, 100, PixelFilter::kDilate), 1.3 * want);
}

TEST(Renderer, SurfaceDepthMatchesTheReferenceOnEveryTarget) {
  ForEachTarget([] {
    RenderSettings settings;
    settings.num_channels = kDepthOnly;
    settings.background[0] = 7;  // has none
    for (size_t n : {size_t{1}, size_t{17}, size_t{150}, size_t{600}}) {
      const Splats splats = MakeSplats(n, n);
      const Camera camera = MakeCamera(61, 43);
      const ReferenceImage want = RenderReference(ToDoubles(splats), camera, settings);
      Renderer renderer;
      Planes depth, alpha;
      renderer.Forward(splats, camera, settings, &depth, &alpha);
      ASSERT_EQ(depth.data.size(), want.image.size());
      int compared = 0, opaque = 0;
      for (size_t i = 0; i < depth.data.size(); ++i) {
        EXPECT_NEAR(alpha.data[i], want.alpha[i], want.fragile[i] ? 1e-2 : 2e-5);
        // Where little weight is left to the surface, its mean is as uncertain.
        const double surface = kSurfaceFrom - (1 - want.alpha[i]);
        if (want.fragile[i] || std::abs(surface) < 0.01) continue;
        ASSERT_NEAR(depth.data[i], want.image[i], surface < 0 ? 1e-4 : 1e-5 / surface) << i;
        ++compared;
        opaque += surface > 0;
      }
      EXPECT_GT(compared, 2 * 61 * 43 / 3);
      if (n >= 150) {
        EXPECT_GT(opaque, 61 * 43 / 10);
      }
    }
  });
}

// As a camera of `focal` px at the origin that looks along Z sees it.
Planes SurfaceDepth(const Splats& splats, int size, double focal) {
  Camera camera;
  camera.width = camera.height = size;
  camera.fx = camera.fy = focal;
  camera.cx = camera.cy = size / 2;
  RenderSettings settings;
  settings.num_channels = kDepthOnly;
  Planes depth, alpha;
  Renderer().Forward(splats, camera, settings, &depth, &alpha);
  return depth;
}

// A haze in front, a wall that lets a fifth of the light through, and what is behind it.
TEST(Renderer, SurfaceDepthIsThatOfTheWall) {
  Splats splats(3);
  const double z[] = {1, 4, 50}, opacity[] = {0.2, 0.75, 0.98};
  for (int i = 0; i < 3; ++i) {
    splats.at(i, kMean + 2) = static_cast<float>(z[i]);
    for (int k = 0; k < 3; ++k) splats.at(i, kLogScale + k) = static_cast<float>(std::log(100));
    splats.at(i, kRawQuat) = 1;
    splats.at(i, kLogitOpacity) = static_cast<float>(std::log(opacity[i] / (1 - opacity[i])));
  }
  for (const float d : SurfaceDepth(splats, 8, 8).data) EXPECT_FLOAT_EQ(d, 4);
  for (int i = 1; i < 3; ++i) splats.at(i, kLogitOpacity) = -40;
  for (const float d : SurfaceDepth(splats, 8, 8).data) EXPECT_FLOAT_EQ(d, 1);  // all there is
  for (const float d : SurfaceDepth(Splats(), 8, 8).data) EXPECT_EQ(d, 0);
}

// One thin disc in a plane that is tilted against the camera, not too far from its centre.
TEST(Renderer, SurfaceDepthFollowsATiltedDisc) {
  Splats disc(1);
  disc.at(0, kMean + 2) = 4;
  for (int k = 0; k < 3; ++k) disc.at(0, kLogScale + k) = static_cast<float>(std::log(0.3));
  disc.at(0, kLogScale + 2) = -12;  // flat along Z, then turned about Y
  disc.at(0, kRawQuat) = static_cast<float>(std::cos(0.25));
  disc.at(0, kRawQuat + 2) = static_cast<float>(std::sin(0.25));
  disc.at(0, kLogitOpacity) = 10;
  const Planes depth = SurfaceDepth(disc, 64, 200);
  for (int x = 24; x < 40; ++x) {
    // The plane through (0, 0, 4): Z = 4 - tan(0.5) X, X = Z (x - cx) / fx.
    const double ray = (x + 0.5 - 32) / 200;
    const double plane = 4 / (1 + std::tan(0.5) * ray);
    EXPECT_NEAR(depth.at(0, 32, x), plane, 0.01 * std::abs(plane - 4) + 0.003) << x;
  }
  EXPECT_GT(std::abs(depth.at(0, 32, 24) - depth.at(0, 32, 39)), 0.1);
}

TEST(Renderer, LampMatchesTheReferenceOnEveryTarget) {
  ForEachTarget([] {
    for (const int channels : {kColorOnly, kWithoutNoise}) {
      RenderSettings settings;
      settings.num_channels = channels;
      settings.lamp = {0.9f, 2.5f};
      ExpectMatchesReference(MakeSplats(150, 3), MakeCamera(61, 43), settings);
    }
  });
}

TEST(Renderer, ALampLightsByTheSquareOfTheDistance) {
  Splats splats = BlockOf(2, false, {0, 0, 0}, 4);
  for (size_t i = 0; i < splats.size(); ++i) {
    for (int row = kShDc; row < kShDc + 3; ++row) splats.at(i, row) = 0.5f;
  }
  RenderSettings settings;
  settings.num_channels = kColorOnly;
  settings.sh_degree = 0;
  Renderer renderer;
  Planes even, lit, alpha;
  for (const double away : {2.0, 4.0, 8.0}) {
    Camera camera = MakeCamera(9, 9);
    ASSERT_TRUE(camera.LookAt({0, 0, -away}, {0, 0, 0}, {0, -1, 0}).ok());
    settings.lamp = {};
    renderer.Forward(splats, camera, settings, &even, &alpha);
    settings.lamp = {2, 4};
    renderer.Forward(splats, camera, settings, &lit, &alpha);
    EXPECT_NEAR(lit.at(0, 4, 4) / even.at(0, 4, 4), 16 / (away * away), 1e-4) << away;
  }
}

TEST(Renderer, DropoutMatchesTheReferenceOnEveryTarget) {
  ForEachTarget([] {
    for (const double share : {0.2, 0.7}) {
      RenderSettings settings;
      settings.dropout = {share, CounterRng(5, 6)};
      for (size_t n : {size_t{1}, size_t{17}, size_t{150}}) {
        ExpectMatchesReference(MakeSplats(n, n), MakeCamera(61, 43), settings);
      }
    }
  });
}

TEST(Renderer, DropoutLeavesOutItsShareAndOthersEachTime) {
  Dropout dropout{0.3, CounterRng(5, 6)};
  const Dropout next{0.3, CounterRng(5, 7)};
  int left_out = 0, both = 0;
  constexpr int kBlocks = 10000;
  for (int block = 0; block < kBlocks; ++block) {
    left_out += std::popcount(dropout.LeftOut(block));
    both += std::popcount(dropout.LeftOut(block) & next.LeftOut(block));
  }
  EXPECT_NEAR(left_out / (16.0 * kBlocks), 0.3, 0.006);
  EXPECT_NEAR(both / (16.0 * kBlocks), 0.09, 0.004);
  dropout.share = 0;
  EXPECT_EQ(dropout.LeftOut(3), 0u);
}

TEST(Renderer, FewerChannelsAreTheSameBytesAsInAWholeRender) {
  ForEachTarget([] {
    const Splats splats = MakeSplats(150, 7);
    const Camera camera = MakeCamera(61, 43);
    RenderSettings settings;
    Renderer renderer;
    Planes all, some, alpha, some_alpha;
    renderer.Forward(splats, camera, settings, &all, &alpha);
    for (const int channels : {kDepthOnly, kColorOnly, kColorAndNoise, kWithoutNoise}) {
      settings.num_channels = channels;
      renderer.Forward(splats, camera, settings, &some, &some_alpha);
      ASSERT_EQ(some.channels, channels);
      EXPECT_EQ(some_alpha.data, alpha.data);
      if (channels == kDepthOnly) continue;  // another depth
      for (int c = 0; c < channels; ++c) {
        const bool moved = channels == kColorAndNoise && c >= 3;
        const float* expected = all.plane(moved ? kChannelNoise + c - 3 : c);
        EXPECT_TRUE(std::equal(expected, expected + all.plane_size(), some.plane(c)))
            << "channel " << c << " of " << channels;
      }
    }
  });
}

TEST(Renderer, PartsAndKeptChannelsAreTheSameBytesAsAWholeRender) {
  Splats splats = MakeSplats(150, 7);
  for (size_t i = 0; i < splats.size(); i += 10) {
    for (int k = 0; k < 3; ++k)
      splats.at(i, kLogScale + k) += 3;  // to more rows than there are spans
  }
  const Camera camera = MakeCamera(121, 83);
  ForEachTarget([&] {
    RenderSettings settings;
    Renderer renderer;
    Planes all, some, alpha, some_alpha;
    renderer.Forward(splats, camera, settings, &all, &alpha);
    const int64_t pairs = renderer.counters().tile_pairs;
    settings.kept_channels = 1u << kChannelStructure | 1u << kChannelNoise;
    for (const size_t max_pairs : {100000, 500, 100, 1}) {
      SCOPED_TRACE(max_pairs);
      settings.max_pairs = max_pairs;
      renderer.Forward(splats, camera, settings, &some, &some_alpha);
      EXPECT_EQ(renderer.counters().tile_pairs, pairs);
      if (max_pairs == 500) {
        EXPECT_LE(renderer.counters().most_pairs, 500);
      }
      EXPECT_EQ(some_alpha.data, alpha.data);
      ASSERT_EQ(some.channels, 2);
      const size_t plane = all.plane_size();
      EXPECT_TRUE(std::equal(some.plane(0), some.plane(1), all.plane(kChannelStructure)));
      EXPECT_TRUE(std::equal(some.plane(1), some.plane(1) + plane, all.plane(kChannelNoise)));
    }
  });
}

TEST(Renderer, MatchesTheReferenceForDegenerateShapes) {
  Splats splats = MakeSplats(60, 3);
  for (size_t i = 0; i < 60; ++i) {
    if (i % 4 == 0) splats.at(i, kLogScale) = 2;        // sheets and needles larger than the view
    if (i % 4 == 1) splats.at(i, kLogScale + 1) = -14;  // flat
    if (i % 4 == 2) splats.at(i, kLogitOpacity) = 40;   // opacity 1
    if (i % 4 == 3) splats.at(i, kLogitOpacity) = -40;  // opacity 0
  }
  ForEachTarget([&] { ExpectMatchesReference(splats, MakeCamera(45, 37), RenderSettings()); });
}

// Its exponent is a difference of numbers that are a billion times as large.
TEST(Renderer, ANeedleWhoseMeanIsFarAwayIsNoMoreOpaqueThanItIs) {
  Camera camera;
  camera.width = 256, camera.height = 192;
  camera.fx = camera.fy = 250, camera.cx = 128, camera.cy = 96;
  Splats needle(1);
  constexpr double kOffset = 64000;  // px, along the needle
  const double length = kOffset / camera.fx, angle = std::atan2(0.6, 0.8);
  needle.at(0, kMean) = 0.8 * length, needle.at(0, kMean + 1) = 0.6 * length;
  needle.at(0, kMean + 2) = 1;
  needle.at(0, kLogScale) = std::log(1.05 * length);
  needle.at(0, kLogScale + 1) = needle.at(0, kLogScale + 2) = std::log(0.01);
  needle.at(0, kRawQuat) = std::cos(angle / 2), needle.at(0, kRawQuat + 3) = std::sin(angle / 2);
  needle.at(0, kLogitOpacity) = -2.9;
  ForEachTarget([&] {
    Planes image, alpha;
    Renderer().Forward(needle, camera, RenderSettings(), &image, &alpha);
    EXPECT_LT(*std::max_element(alpha.data.begin(), alpha.data.end()), 1.01 / (1 + std::exp(2.9)));
  });
}

TEST(Renderer, EmptySceneReturnsBackground) {
  Renderer renderer;
  RenderSettings settings;
  settings.background[1] = 0.25f;
  Planes image, alpha;
  renderer.Forward(Splats(), MakeCamera(20, 10), settings, &image, &alpha);
  for (float a : alpha.data) EXPECT_EQ(a, 0);
  for (size_t i = 0; i < image.plane_size(); ++i) EXPECT_EQ(image.plane(1)[i], 0.25f);
  renderer.Backward(Splats(), image, alpha, [](size_t, const float*, uint32_t) { FAIL(); });
}

TEST(Renderer, OneColourOnItselfRendersThatColour) {
  Splats splats = MakeSplats(80, 4);
  for (size_t i = 0; i < splats.size(); ++i) {
    for (int row = kShDc; row < kSplatRows; ++row) splats.at(i, row) = 0;
  }
  RenderSettings settings;
  settings.background.fill(0.5f);  // SH 0 is grey 0.5, as the background
  Renderer renderer;
  Planes image, alpha;
  renderer.Forward(splats, MakeCamera(50, 40), settings, &image, &alpha);
  for (size_t i = 0; i < image.plane_size(); ++i) EXPECT_NEAR(image.plane(0)[i], 0.5f, 1e-6);
}

TEST(Renderer, NotANumberAndInfinityInOneGaussianLeaveTheOthersAlone) {
  Splats splats = MakeSplats(40, 5);
  Splats without(39);
  for (size_t i = 0; i < 39; ++i) without.Copy(splats, i, i);
  Renderer renderer;
  Planes want, want_alpha, image, alpha;
  ForEachTarget([&] {
    constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
    renderer.Forward(without, MakeCamera(40, 30), RenderSettings(), &want, &want_alpha);
    for (const int row : {int{kMean}, int{kLogScale}, int{kRawQuat}, int{kLogitOpacity}}) {
      for (const float bad : {kNan, std::numeric_limits<float>::infinity()}) {
        const float kept = std::exchange(splats.at(39, row), bad);
        renderer.Forward(splats, MakeCamera(40, 30), RenderSettings(), &image, &alpha);
        splats.at(39, row) = kept;
        for (const float x : image.data) ASSERT_TRUE(std::isfinite(x)) << row << " " << bad;
        const bool unseen = row == kMean || (row == kLogitOpacity && std::isnan(bad));
        if (unseen) {
          EXPECT_EQ(image.data, want.data) << row << " " << bad;
        }
      }
    }
  });
}

TEST(Renderer, OrderOfGaussiansDoesNotMatter) {
  const Splats splats = MakeSplats(200, 13);
  Splats reversed(200);
  for (size_t i = 0; i < 200; ++i) reversed.Copy(splats, 199 - i, i);
  Renderer renderer;
  Planes a, b, alpha;
  renderer.Forward(splats, MakeCamera(70, 50), RenderSettings(), &a, &alpha);
  renderer.Forward(reversed, MakeCamera(70, 50), RenderSettings(), &b, &alpha);
  EXPECT_EQ(a.data, b.data);
}

TEST(Renderer, MillionGaussiansRender) {
  const Splats splats = MakeSplats(1000000, 14);
  Renderer renderer;
  Planes image, alpha;
  renderer.Forward(splats, MakeCamera(64, 48), RenderSettings(), &image, &alpha);
  EXPECT_GT(renderer.counters().visible, 100000);
  for (float a : alpha.data) {
    EXPECT_GE(a, 0.0f);
    EXPECT_LE(a, 1.0f);
  }
}

}  // namespace
}  // namespace litags
