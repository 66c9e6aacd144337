// Renderer::Backward, and what it sums up for density control.
#include <algorithm>
#include <cmath>
#include <cstring>
#include <tuple>
#include <vector>

#include "engine/core/rng.h"
#include "engine/core/simd_test_util.h"
#include "engine/render/reference_renderer.h"
#include "engine/render/renderer.h"
#include "engine/render/renderer_test_util.h"
#include "gtest/gtest.h"

namespace litags {
namespace {

// Loss = sum(weights * image) + sum(weights * alpha), with weights zero on fragile pixels.
struct Loss {
  Planes v_image, v_alpha;
  double Of(const ReferenceImage& r) const {
    double sum = 0;
    for (size_t i = 0; i < r.image.size(); ++i) sum += r.image[i] * v_image.data[i];
    for (size_t i = 0; i < r.alpha.size(); ++i) sum += r.alpha[i] * v_alpha.data[i];
    return sum;
  }
};

Loss MakeLoss(const Splats& splats, const Camera& camera, const RenderSettings& settings) {
  const ReferenceImage r = RenderReference(ToDoubles(splats), camera, settings);
  Loss loss{Planes(settings.num_channels, camera.height, camera.width),
            Planes(1, camera.height, camera.width)};
  const CounterRng rng(9, 9);
  const size_t plane = loss.v_alpha.data.size();
  for (size_t i = 0; i < loss.v_image.data.size(); ++i) {
    loss.v_image.data[i] = r.fragile[i % plane] ? 0 : rng.Normal(i);
  }
  for (size_t i = 0; i < plane; ++i)
    loss.v_alpha.data[i] = r.fragile[i] ? 0 : rng.Normal(1000000 + i);
  return loss;
}

std::vector<double> Gradient(const Splats& splats, const Camera& camera,
                             const RenderSettings& settings, const Loss& loss) {
  Renderer renderer;
  Planes image, alpha;
  renderer.Forward(splats, camera, settings, &image, &alpha);
  Splats grads(splats.size());
  renderer.Backward(splats, loss.v_image, loss.v_alpha,
                    [&](size_t block, const float* g, uint32_t) {
                      std::memcpy(grads.block(block), g, sizeof(float) * Splats::kBlockFloats);
                    });
  return ToDoubles(grads);
}

TEST(RendererVjp, GradientsMatchFiniteDifferencesOnEveryTarget) {
  const Camera camera = MakeCamera(27, 21);
  const Splats splats = MakeSplats(18, 11);
  using Case = std::tuple<DepthSource, int, PixelFilter>;
  for (const auto& [source, channels, filter] :
       {Case(DepthSource::kAttribute, kNumChannels, PixelFilter::kDilate),
        Case(DepthSource::kCameraZ, kNumChannels, PixelFilter::kMip),
        Case(DepthSource::kAttribute, kWithoutNoise, PixelFilter::kMip)}) {
    RenderSettings settings;
    settings.num_channels = channels;
    settings.depth_source = source;
    settings.pixel_filter = filter;
    settings.background[2] = 0.7f;
    if (source == DepthSource::kCameraZ) settings.dropout = {0.3, CounterRng(5, 6)};
    if (filter == PixelFilter::kMip) settings.lamp = {0.8f, 3.0f};
    const Loss loss = MakeLoss(splats, camera, settings);
    std::vector<double> params = ToDoubles(splats);
    std::vector<double> want(params.size());
    for (size_t i = 0; i < params.size(); ++i) {
      const double h = 1e-5, kept = params[i];
      params[i] = kept + h;
      const double up = loss.Of(RenderReference(params, camera, settings));
      params[i] = kept - h;
      const double down = loss.Of(RenderReference(params, camera, settings));
      params[i] = kept;
      want[i] = (up - down) / (2 * h);
    }
    ForEachTarget([&] {
      const std::vector<double> got = Gradient(splats, camera, settings, loss);
      for (int row = 0; row < kSplatRows; ++row) {
        double scale = 1e-3, worst = 0;
        for (size_t i = row; i < want.size(); i += kSplatRows) {
          scale = std::max(scale, std::abs(want[i]));
          worst = std::max(worst, std::abs(got[i] - want[i]));
        }
        // Single precision reaches 2e-5 of the largest entry; differences add their own 1e-6.
        EXPECT_LT(worst, 2e-4 * scale) << "row " << row;
      }
    });
  }
}

TEST(RendererVjp, LongListsAndOpaquePixelsMatchADirectionalDerivativeOnEveryTarget) {
  const Camera camera = MakeCamera(27, 21);
  Splats splats = MakeSplats(300, 11);
  for (size_t i = 0; i < splats.size(); ++i) splats.at(i, kLogitOpacity) += 3;
  const RenderSettings settings;
  const Loss loss = MakeLoss(splats, camera, settings);
  const std::vector<double> params = ToDoubles(splats);
  const std::vector<double> alpha = RenderReference(params, camera, settings).alpha;
  EXPECT_GT(*std::max_element(alpha.begin(), alpha.end()), 1 - 2e-4) << "none is opaque";
  std::vector<double> direction(params.size());
  const CounterRng rng(21, 3);
  for (size_t i = 0; i < direction.size(); ++i) direction[i] = rng.Normal(i);
  const auto moved = [&](double by) {
    std::vector<double> at = params;
    for (size_t i = 0; i < at.size(); ++i) at[i] += by * direction[i];
    return loss.Of(RenderReference(at, camera, settings));
  };
  const double h = 1e-6, want = (moved(h) - moved(-h)) / (2 * h);
  ForEachTarget([&] {
    const std::vector<double> got = Gradient(splats, camera, settings, loss);
    double slope = 0, squares = 0;
    for (size_t i = 0; i < got.size(); ++i) {
      slope += got[i] * direction[i];
      squares += got[i] * got[i];
    }
    EXPECT_NEAR(slope, want, 2e-4 * std::sqrt(squares));
  });
}

// The camera after x_cam' = x_cam + w x x_cam + v, which is a turn and a shift to first order.
Camera Moved(Camera camera, int k, double by) {
  if (k >= 3) {
    camera.t[k - 3] += by;
    return camera;
  }
  const int i = (k + 1) % 3, j = (k + 2) % 3;
  const Camera kept = camera;
  for (int c = 0; c < 3; ++c) {
    camera.R[3 * i + c] -= by * kept.R[3 * j + c];
    camera.R[3 * j + c] += by * kept.R[3 * i + c];
  }
  camera.t[i] -= by * kept.t[j];
  camera.t[j] += by * kept.t[i];
  return camera;
}

TEST(RendererVjp, PoseGradientsMatchFiniteDifferencesOnEveryTarget) {
  const Camera camera = MakeCamera(27, 21);
  const Splats splats = MakeSplats(40, 11);  // two blocks and a half
  for (const auto& [source, channels, filter] :
       {std::tuple(DepthSource::kAttribute, int{kColorOnly}, PixelFilter::kDilate),
        std::tuple(DepthSource::kCameraZ, int{kNumChannels}, PixelFilter::kMip)}) {
    RenderSettings settings;
    settings.num_channels = channels;
    settings.depth_source = source;
    settings.pixel_filter = filter;
    settings.pose_grad = true;
    if (filter == PixelFilter::kMip) settings.lamp = {0.8f, 3.0f};
    const Loss loss = MakeLoss(splats, camera, settings);
    const std::vector<double> params = ToDoubles(splats);
    PoseVector want;
    double scale = 0;
    for (int k = 0; k < 6; ++k) {
      const double h = 1e-5;
      want[k] = (loss.Of(RenderReference(params, Moved(camera, k, h), settings)) -
                 loss.Of(RenderReference(params, Moved(camera, k, -h), settings))) /
                (2 * h);
      scale = std::max(scale, std::abs(want[k]));
    }
    ForEachTarget([&] {
      for (const int threads : {1, 3}) {
        settings.threads = threads;
        Renderer renderer;
        Planes image, alpha;
        renderer.Forward(splats, camera, settings, &image, &alpha);
        renderer.Backward(splats, loss.v_image, loss.v_alpha,
                          [](size_t, const float*, uint32_t) {});
        for (int k = 0; k < 6; ++k) {
          EXPECT_NEAR(renderer.pose_grad()[k], want[k], 2e-4 * scale) << "number " << k;
        }
      }
    });
  }
}

TEST(RendererVjp, DetachedChannelsReachTheirOwnValuesOnly) {
  const Camera camera = MakeCamera(61, 43);
  const Splats splats = MakeSplats(90, 21);
  RenderSettings settings;
  settings.num_channels = kWithoutNoise;
  settings.background[kChannelStructure] = 0.3f;
  const Loss loss = MakeLoss(splats, camera, settings);
  Loss without = loss;
  std::fill_n(without.v_image.plane(kChannelStructure), without.v_image.plane_size(), 0.0f);
  ForEachTarget([&] {
    const std::vector<double> attached = Gradient(splats, camera, settings, loss);
    const std::vector<double> no_structure = Gradient(splats, camera, settings, without);
    RenderSettings detached = settings;
    detached.detached_channels = 1u << kChannelStructure;
    const std::vector<double> got = Gradient(splats, camera, detached, loss);
    double structure = 0;
    for (size_t i = 0; i < got.size(); ++i) {
      const bool own = i % kSplatRows == kStructure;
      ASSERT_EQ(got[i], own ? attached[i] : no_structure[i]) << "row " << i % kSplatRows;
      if (own) structure += std::abs(got[i]);
    }
    EXPECT_GT(structure, 0);
    EXPECT_NE(attached, got) << "it moved nothing in the first place";
  });
}

TEST(RendererVjp, GradientRowsPastTheShDegreeAreZero) {
  const Camera camera = MakeCamera(27, 21);
  const Splats splats = MakeSplats(18, 11);
  RenderSettings settings;
  settings.num_channels = 3;
  settings.sh_degree = 1;
  const std::vector<double> grads =
      Gradient(splats, camera, settings, MakeLoss(splats, camera, settings));
  double used = 0;
  for (size_t i = 0; i < grads.size(); ++i) {
    if (int(i % kSplatRows) >= SplatRowsForDegree(1)) {
      EXPECT_EQ(grads[i], 0);
    }
    if (i % kSplatRows == kShRest) used += std::abs(grads[i]);
  }
  EXPECT_GT(used, 0);
}

TEST(RendererVjp, ResultsAreTheSameBytesForAnyThreadCount) {
  const Camera camera = MakeCamera(150, 110);
  const Splats splats = MakeSplats(3000, 12);
  RenderSettings settings;
  settings.threads = 1;
  const Loss loss = MakeLoss(splats, camera, settings);
  const std::vector<double> want = Gradient(splats, camera, settings, loss);
  for (int threads : {2, 5}) {
    settings.threads = threads;
    EXPECT_EQ(Gradient(splats, camera, settings, loss), want) << threads << " threads";
  }
}

}  // namespace
}  // namespace litags
