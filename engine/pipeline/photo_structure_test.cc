#include "engine/pipeline/photo_structure.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "engine/core/rng.h"

namespace litags {
namespace {

// Codes of a scene of this mean code, with a sensor's noise about them, cut off at black.
template <class Scene>
Photo Dark(int width, int height, double mean_code, int seed, const Scene& scene) {
  Photo photo(width, height);
  const CounterRng rng(seed, 1);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      for (int c = 0; c < 3; ++c) {
        const double noise = 1.2 * rng.Normal((size_t(y) * width + x) * 3 + c);
        const double code = std::clamp(mean_code * scene(x, y) + noise, 0.0, 255.0);
        photo.pixel(x, y)[c] = static_cast<int16_t>(std::lround(code) * kPhotoCode);
      }
    }
  }
  return photo;
}

double Nothing(int, int) { return 0; }

// Each pixel is the mean of `n` x `n` of them, as cameras smooth noise away.
Photo Smoothed(const Photo& photo, int n) {
  Photo out(photo.width - n, photo.height - n);
  for (int y = 0; y < out.height; ++y) {
    for (int x = 0; x < out.width; ++x) {
      for (int c = 0; c < 3; ++c) {
        int sum = 0;
        for (int i = 0; i < n * n; ++i) sum += photo.pixel(x + i % n, y + i / n)[c];
        out.pixel(x, y)[c] = static_cast<int16_t>(sum / (n * n));
      }
    }
  }
  return out;
}

TEST(StructureOf, NoiseHasNone) {
  for (const auto& [width, height] :
       {std::pair(64, 48), std::pair(270, 480), std::pair(1200, 800)}) {
    for (int seed = 0; seed < 5; ++seed) {
      const Photo cap = Dark(width, height, 0, seed, Nothing);
      EXPECT_LT(StructureOf(cap), kNoStructure) << width << "x" << height;
      if (width < 200) continue;
      EXPECT_LT(StructureOf(Smoothed(cap, 3)), kNoStructure) << width << "x" << height;
    }
  }
}

TEST(StructureOf, ADarkSceneHas) {
  const auto room = [](int x, int y) {
    return (x / 60 + y / 70) % 3 == 0 ? 1.6 : 0.6 + 0.2 * std::sin(0.02 * x) + 0.1 * (x % 7 == 0);
  };
  for (const double code : {8.0, 4.0, 2.0, 1.0, 0.3}) {
    EXPECT_GT(StructureOf(Dark(640, 480, code, 1, room)), 2 * kNoStructure) << code;
  }
  // A lamp far away in an unlit place.
  const auto lamp = [](int x, int y) { return std::hypot(x - 400, y - 100) < 30 ? 30.0 : 0.0; };
  EXPECT_GT(StructureOf(Dark(640, 480, 1, 1, lamp)), 2 * kNoStructure);
}

// Light and dark may alternate from block to block, along one direction or both.
TEST(StructureOf, PatternsHave) {
  const auto checkers = [](int x, int y) { return (x / 16 + y / 16) % 2 ? 1.5 : 0.5; };
  const auto slats = [](int x, int) { return x / 16 % 2 ? 1.5 : 0.5; };
  EXPECT_GT(StructureOf(Dark(640, 480, 4, 1, checkers)), 0.9);
  EXPECT_GT(StructureOf(Dark(640, 480, 4, 1, slats)), 0.9);
}

TEST(StructureOf, IsNotDeniedToWhatSaysTooLittle) {
  EXPECT_EQ(StructureOf(Dark(30, 20, 0, 1, Nothing)), 1);
  EXPECT_EQ(StructureOf(Photo(640, 480)), 1);
}

}  // namespace
}  // namespace litags
