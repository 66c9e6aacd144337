#include "engine/denoise/noise_filter.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "engine/core/rng.h"
#include "engine/core/simd_test_util.h"
#include "gtest/gtest.h"

namespace litags {
namespace {

NoiseCurve Constant(float deviation) {
  NoiseCurve curve;
  curve.fill(deviation);
  return curve;
}

// More noise the darker, as rounding leaves it.
NoiseCurve Falling() {
  NoiseCurve curve;
  for (size_t i = 0; i < curve.size(); ++i) curve[i] = 0.08f / (1 + 0.05f * i);
  return curve;
}

double Luma(const Planes& p, int y, int x) {
  return 0.299 * p.at(0, y, x) + 0.587 * p.at(1, y, x) + 0.114 * p.at(2, y, x);
}

// The filter in double precision, window by window.
std::vector<double> Reference(const NoiseCurve& noise, const Planes& p) {
  const auto row = [&](int y) { return std::clamp(y, 0, p.height - 1); };
  const auto column = [&](int x) { return std::clamp(x, 0, p.width - 1); };
  struct Window {
    double a;
    double mean[3];
  };
  std::vector<Window> windows(p.plane_size());
  for (int y = 0; y < p.height; ++y) {
    for (int x = 0; x < p.width; ++x) {
      double sum[3] = {}, luma = 0, squares = 0;
      for (int j = -2; j <= 2; ++j) {
        for (int i = -2; i <= 2; ++i) {
          const double l = Luma(p, row(y + j), column(x + i));
          luma += l / 25;
          squares += l * l / 25;
          for (int c = 0; c < 3; ++c) sum[c] += p.at(c, row(y + j), column(x + i)) / 25.0;
        }
      }
      const double v = squares - luma * luma;
      const double n = noise[std::clamp<long>(std::lround(255 * luma), 0, 255)];
      Window& w = windows[size_t(y) * p.width + x];
      w.a = v > n * n ? (v - n * n) / v : 0;
      for (int c = 0; c < 3; ++c) w.mean[c] = sum[c];
    }
  }
  std::vector<double> out(p.data.size());
  for (int c = 0; c < 3; ++c) {
    for (int y = 0; y < p.height; ++y) {
      for (int x = 0; x < p.width; ++x) {
        double value = 0;
        for (int j = -2; j <= 2; ++j) {
          for (int i = -2; i <= 2; ++i) {
            const Window& w = windows[size_t(row(y + j)) * p.width + column(x + i)];
            value += (w.a * p.at(c, y, x) + (1 - w.a) * w.mean[c]) / 25;
          }
        }
        out[c * p.plane_size() + size_t(y) * p.width + x] = value;
      }
    }
  }
  return out;
}

// A dark left half and a bright right one, each with noise of its own brightness, some of it below
// 0.
Planes TwoHalves(int height, int width, const NoiseCurve& noise, double scale = 1) {
  Planes p(3, height, width);
  const CounterRng rng(5, width);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const float level = x < width / 2 ? 0.1f : 0.8f;
      const double deviation = scale * noise[std::lround(255 * level)];
      for (int c = 0; c < 3; ++c) {
        p.at(c, y, x) = level * (1.1f - 0.1f * c) +
                        deviation * rng.Normal(c * p.plane_size() + size_t(y) * width + x);
      }
    }
  }
  return p;
}

double Deviation(const Planes& p, int from, int to) {
  double sum = 0, squares = 0;
  for (int y = 0; y < p.height; ++y) {
    for (int x = from; x < to; ++x) {
      sum += Luma(p, y, x);
      squares += Luma(p, y, x) * Luma(p, y, x);
    }
  }
  const double n = double(p.height) * (to - from);
  return std::sqrt(std::max(0.0, squares / n - sum * sum / n / n));
}

TEST(NoiseFilter, MatchesItsDefinitionOnEveryTarget) {
  for (const auto& [height, width] : {std::pair(1, 1), {2, 3}, {5, 16}, {19, 45}, {40, 33}}) {
    const Planes in = TwoHalves(height, width, Falling(), 1.5);
    const std::vector<double> expected = Reference(Falling(), in);
    ForEachTarget([&, height = height, width = width] {
      Planes out = in;
      NoiseFilter(1).Apply(Falling(), out);
      for (size_t i = 0; i < out.data.size(); ++i) {
        // A hundredth of a code: a variance is the difference of two numbers near 0.64.
        ASSERT_NEAR(out.data[i], expected[i], 4e-5) << height << "x" << width << ", sample " << i;
      }
    });
  }
}

TEST(NoiseFilter, SmoothsNoiseAndKeepsWhatIsLarger) {
  const NoiseCurve noise = Falling();
  const Planes in = TwoHalves(64, 128, noise, 0.7);
  Planes out = in;
  NoiseFilter(1).Apply(noise, out);
  EXPECT_LT(Deviation(out, 0, 56), 0.35 * Deviation(in, 0, 56));
  EXPECT_LT(Deviation(out, 72, 128), 0.35 * Deviation(in, 72, 128));
  // The edge between the halves stays where it is.
  double before = 0, after = 0;
  for (int y = 0; y < in.height; ++y) {
    before += (Luma(in, y, 64) - Luma(in, y, 63)) / in.height;
    after += (Luma(out, y, 64) - Luma(out, y, 63)) / in.height;
  }
  EXPECT_NEAR(after, before, 0.02 * before);
}

TEST(NoiseFilter, LeavesTextureThatIsLargerThanTheNoise) {
  const Planes in = TwoHalves(32, 64, Constant(0.1f));
  Planes out = in;
  NoiseFilter(1).Apply(Constant(0.01f), out);
  EXPECT_GT(Deviation(out, 0, 32), 0.95 * Deviation(in, 0, 32));
}

TEST(NoiseFilter, WithoutNoiseNothingChanges) {
  const Planes in = TwoHalves(20, 30, Falling());
  Planes out = in;
  NoiseFilter(1).Apply(Constant(0), out);
  for (size_t i = 0; i < in.data.size(); ++i) ASSERT_NEAR(out.data[i], in.data[i], 1e-6) << i;
}

TEST(NoiseFilter, SameBytesForAnyThreadsAndAfterOtherSizes) {
  const Planes in = TwoHalves(75, 93, Falling());
  Planes one = in, three = in, other = TwoHalves(120, 200, Falling());
  NoiseFilter(1).Apply(Falling(), one);
  NoiseFilter filter(3);
  filter.Apply(Falling(), other);
  filter.Apply(Falling(), three);
  EXPECT_EQ(one.data, three.data);
}

TEST(NoiseFilter, BadNumbersStayWhereTheyAre) {
  Planes p = TwoHalves(30, 40, Falling());
  p.at(1, 10, 10) = std::numeric_limits<float>::quiet_NaN();
  p.at(2, 20, 30) = std::numeric_limits<float>::infinity();
  p.at(0, 5, 35) = -3;
  NoiseFilter(1).Apply(Falling(), p);
  EXPECT_TRUE(std::isnan(p.at(1, 10, 10)));
  EXPECT_TRUE(std::isfinite(p.at(1, 10, 15)) && std::isfinite(p.at(1, 25, 5)));
}

}  // namespace
}  // namespace litags
