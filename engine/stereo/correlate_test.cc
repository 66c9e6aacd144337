#include "engine/stereo/correlate.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/core/rng.h"
#include "engine/core/simd_test_util.h"

namespace litags {
namespace {

// Noise, smoothed so that pixels in between mean something.
MatchImage Textured(int width, int height, uint64_t seed) {
  MatchImage image;
  image.camera.width = width;
  image.camera.height = height;
  image.camera.fx = image.camera.fy = width;
  image.camera.cx = width / 2.0;
  image.camera.cy = height / 2.0;
  image.gray = Planes(1, height, width);
  image.noise = 0.01f;
  const CounterRng rng(seed, 0);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      for (int k = 0; k < 4; ++k) {
        image.gray.at(0, y, x) += static_cast<float>(
            0.25 * rng.Uniform(uint64_t(y + k / 2) * (width + 1) + x + k % 2) - 0.125);
      }
    }
  }
  return image;
}

// The definition, in double, one pixel at a time.
double Reference(const MatchImage& r, const MatchImage& s, const Transfer& t,
                 const std::vector<float>& inverse_depth, int radius, int x, int y) {
  const int w = r.gray.width, h = r.gray.height;
  bool center_seen = false;
  const auto warped = [&](int px, int py) {
    double q[3];
    const double u = px + 0.5, v = py + 0.5;
    for (int i = 0; i < 3; ++i) {
      q[i] = t.ray[3 * i] * u + t.ray[3 * i + 1] * v + t.ray[3 * i + 2] +
             double(inverse_depth[py * w + px]) * t.shift[i];
    }
    const double sx = q[0] / q[2] - 0.5, sy = q[1] / q[2] - 0.5;
    if (px == x && py == y) {
      center_seen =
          q[2] > 0 && sx >= 0 && sy >= 0 && sx <= s.gray.width - 1 && sy <= s.gray.height - 1;
    }
    const double cx = std::clamp(sx, 0.0, s.gray.width - 1.0);
    const double cy = std::clamp(sy, 0.0, s.gray.height - 1.0);
    const int ix = std::min(static_cast<int>(cx), s.gray.width - 2);
    const int iy = std::min(static_cast<int>(cy), s.gray.height - 2);
    const double fx = cx - ix, fy = cy - iy;
    return (1 - fy) * ((1 - fx) * s.gray.at(0, iy, ix) + fx * s.gray.at(0, iy, ix + 1)) +
           fy * ((1 - fx) * s.gray.at(0, iy + 1, ix) + fx * s.gray.at(0, iy + 1, ix + 1));
  };
  double n = 0, sw = 0, sr = 0, sww = 0, srr = 0, swr = 0;
  for (int dy = -radius; dy <= radius; ++dy) {
    for (int dx = -radius; dx <= radius; ++dx) {
      const int px = std::clamp(x + dx, 0, w - 1), py = std::clamp(y + dy, 0, h - 1);
      const double vw = warped(px, py), vr = r.gray.at(0, py, px);
      n += 1, sw += vw, sr += vr, sww += vw * vw, srr += vr * vr, swr += vw * vr;
    }
  }
  const double cov = swr / n - sw / n * sr / n;
  const double var_w = sww / n - sw / n * sw / n + s.noise * s.noise;
  const double var_r = srr / n - sr / n * sr / n + r.noise * r.noise;
  return center_seen ? cov / std::sqrt(var_w * var_r) : 0;
}

TEST(Correlate, AgreesWithItsDefinitionOnEveryTarget) {
  for (const int width : {17, 32, 47}) {
    const MatchImage reference = Textured(width, 19, 1), source = [&] {
      MatchImage s = Textured(width + 3, 23, 2);
      s.camera.t = {-0.2, 0.05, 0.1};
      s.camera.R = {std::cos(0.1), 0, std::sin(0.1), 0, 1, 0, -std::sin(0.1), 0, std::cos(0.1)};
      return s;
    }();
    const Transfer transfer(reference.camera, source.camera);
    std::vector<float> inverse_depth(reference.gray.plane_size());
    const CounterRng rng(3, 0);
    for (size_t i = 0; i < inverse_depth.size(); ++i) {
      inverse_depth[i] = static_cast<float>(0.5 + 0.1 * rng.Uniform(i));
    }
    for (const int radius : {1, 2, 3}) {
      ForEachTarget([&] {
        const CorrelationReference statistics(reference, radius);
        std::vector<float> scratch, zncc(inverse_depth.size());
        Correlate(statistics, source, transfer, inverse_depth.data(), &scratch, zncc.data());
        int seen = 0;
        for (int y = 0; y < 19; ++y) {
          for (int x = 0; x < width; ++x) {
            const double expected =
                Reference(reference, source, transfer, inverse_depth, radius, x, y);
            seen += expected != 0;
            // Positions are rounded to 1e-6 of some 50 px, slopes are about 0.3 a pixel.
            ASSERT_NEAR(zncc[y * width + x], expected, 1e-3) << x << " " << y;
          }
        }
        EXPECT_GT(seen, 100);
      });
    }
  }
}

TEST(Correlate, GainAndBlackLevelOfThePhotosDoNotMatter) {
  const MatchImage reference = Textured(40, 30, 1);
  MatchImage source = reference;
  for (float& v : source.gray.data) v = 0.3f * v + 0.2f;
  source.noise = 0;  // noise in the denominator is no part of the claim
  const std::vector<float> inverse_depth(reference.gray.plane_size(), 0.7f);
  std::vector<float> scratch, zncc(inverse_depth.size());
  MatchImage clean = reference;
  clean.noise = 0;
  const CorrelationReference statistics(clean, 2);
  Correlate(statistics, source, Transfer(clean.camera, source.camera), inverse_depth.data(),
            &scratch, zncc.data());
  for (const float fit : zncc) EXPECT_NEAR(fit, 1, 2e-3);
}

TEST(Correlate, WhereThereIsOnlyNoiseTheAnswerIsNearZero) {
  MatchImage reference = Textured(40, 30, 1);
  for (float& v : reference.gray.data) v *= 0.01f;  // a tenth of the noise's deviation
  const std::vector<float> inverse_depth(reference.gray.plane_size(), 0.7f);
  std::vector<float> scratch, zncc(inverse_depth.size());
  const CorrelationReference statistics(reference, 2);
  Correlate(statistics, reference, Transfer(reference.camera, reference.camera),
            inverse_depth.data(), &scratch, zncc.data());
  for (const float fit : zncc) EXPECT_LT(std::abs(fit), 0.05);
}

// Of a photo that is of one value the measured noise is 0.
TEST(Correlate, OneValueFitsNothingWithoutNoiseEither) {
  const MatchImage textured = Textured(40, 30, 1);
  MatchImage black = textured;
  std::fill(black.gray.data.begin(), black.gray.data.end(), -0.8f);
  black.noise = 0;
  const std::vector<float> inverse_depth(textured.gray.plane_size(), 0.7f);
  for (const MatchImage& reference : {textured, black}) {
    ForEachTarget([&] {
      std::vector<float> scratch, zncc(inverse_depth.size());
      const CorrelationReference statistics(reference, 2);
      Correlate(statistics, black, Transfer(reference.camera, black.camera), inverse_depth.data(),
                &scratch, zncc.data());
      // Rounding of floats is left. Infinities and NaN fail.
      for (const float fit : zncc) ASSERT_LT(std::abs(fit), 0.1);
    });
  }
}

}  // namespace
}  // namespace litags
