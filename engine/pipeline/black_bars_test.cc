#include "engine/pipeline/black_bars.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <vector>

#include "engine/core/image.h"
#include "engine/core/rng.h"
#include "engine/io/image_io.h"

namespace litags {
namespace {

constexpr int kW = 200, kH = 120;

// The code of a pixel of photo `i`, without noise.
using Scene = std::function<double(int i, int x, int y)>;

std::optional<BarFrame> Find(const Scene& scene, double noise = 1, int photos = 6,
                             bool blocks = false) {
  std::vector<LineKinds> lines;
  for (int i = 0; i < photos; ++i) {
    Photo photo(kW, kH);
    const CounterRng rng(i, 1);
    for (int y = 0; y < kH; ++y) {
      for (int x = 0; x < kW; ++x) {
        const double code = scene(i, x, y);
        const double off = code > 0 ? noise * rng.Normal(size_t(y) * kW + x) : 0;
        const double sample = std::clamp(std::round(code + off), 0.0, 255.0) * kPhotoCode;
        std::fill_n(photo.pixel(x, y), 3, static_cast<int16_t>(sample));
      }
    }
    lines.push_back(KindsOfLines(photo));
  }
  std::vector<const LineKinds*> all;
  for (const LineKinds& l : lines) all.push_back(&l);
  return FindBars(all, blocks);
}

// A dark picture that moves, between bars.
Scene Film(int top, int bottom, int left, int right) {
  return [=](int i, int x, int y) {
    if (y < top || y >= kH - bottom || x < left || x >= kW - right) return 0.0;
    return (x + 9 * i) / 25 % 2 == 0 ? 2.0 : 6.0;
  };
}

TEST(FindBars, LetterboxAndPillarbox) {
  const auto both = Find(Film(15, 14, 40, 40));
  ASSERT_TRUE(both.has_value());
  EXPECT_EQ(both->rows.first, 15);
  EXPECT_EQ(both->rows.last, kH - 14);
  EXPECT_EQ(both->columns.first, 40);
  EXPECT_EQ(DescribeBars(*both, kW, kH),
            "rows 0 to 14 and 106 to 119, columns 0 to 39 and 160 to 199");
  const auto lossy = Find(Film(15, 14, 0, 0), 1, 6, /*blocks=*/true);
  ASSERT_TRUE(lossy.has_value());
  EXPECT_EQ(lossy->rows.first, 16);
  EXPECT_EQ(lossy->rows.last, 96);
  EXPECT_EQ(lossy->columns.last, kW);
}

// A photo as JPEG's decoder gives it: blocks have mixed the colours of bar and picture.
TEST(FindBars, BarsThatEndInsideABlockAreTakenWhole) {
  for (const int bar : {25, 33, 41, 48}) {
    std::vector<LineKinds> lines;
    for (int i = 0; i < 4; ++i) {
      ImageU8 photo(kW, 160);
      const CounterRng rng(i, 1);
      for (int y = bar; y < 160 - bar; ++y) {
        for (int x = 0; x < kW; ++x) {
          const auto bits = rng.Bits(size_t(y) * kW + x);
          for (int c = 0; c < 3; ++c) photo.pixel(x, y)[c] = 8 - 2 * c + (bits >> c) % 4;
        }
      }
      const auto decoded = DecodePhoto(EncodeJpeg(photo, 95).value(), "photo");
      ASSERT_TRUE(decoded.ok()) << decoded.status();
      lines.push_back(KindsOfLines(*decoded));
    }
    std::vector<const LineKinds*> all;
    for (const LineKinds& l : lines) all.push_back(&l);
    const auto bars = FindBars(all, /*blocks=*/true);
    ASSERT_TRUE(bars.has_value()) << bar;
    const int grid = (bar + 15) / 16 * 16;
    EXPECT_EQ(bars->rows.first, grid) << bar;
    EXPECT_EQ(bars->rows.last, 160 - grid) << bar;
  }
}

TEST(FindBars, NoneWhereThePictureGoesToTheEdge) {
  EXPECT_FALSE(Find(Film(0, 0, 0, 0)).has_value());
  EXPECT_FALSE(Find(Film(2, 2, 0, 0)).has_value());  // a rim
  EXPECT_FALSE(Find(Film(15, 15, 0, 0), 1, /*photos=*/2).has_value());
  EXPECT_FALSE(Find(Film(40, 40, 0, 0)).has_value());  // hardly a picture
  EXPECT_FALSE(Find(Film(15, 0, 0, 0)).has_value());
  EXPECT_FALSE(Find(Film(40, 15, 0, 0)).has_value());
  const Scene film = Film(15, 15, 0, 0), whole = Film(0, 0, 0, 0);
  EXPECT_FALSE(Find([&](int i, int x, int y) {
                 return i == 3 ? whole(i, x, y) : film(i, x, y);
               }).has_value());
}

// A camera that smooths noise away leaves black where it sees none, and that is the scene.
TEST(FindBars, BlackSkyAndFloorAreNone) {
  EXPECT_FALSE(Find(
                   [](int i, int x, int y) {
                     const double skyline = 20 + 12 * i + 4 * std::sin(0.1 * x);
                     return y < skyline || y > 140 - skyline + 40 * (i % 2) ? 0.0 : 5.0 + x % 3;
                   },
                   0)
                   .has_value());
}

// What a torch does not reach fades.
TEST(FindBars, TheRimOfATorchsLightIsNone) {
  EXPECT_FALSE(Find(
                   [](int i, int x, int y) {
                     const double r = std::hypot(x - kW / 2, 1.5 * (y - kH / 2));
                     return std::floor((9 + (x + 3 * i) % 4) * std::exp(-r * r / 1200));
                   },
                   0)
                   .has_value());
}

TEST(FindBars, DarkRowsWithASensorsNoiseAreNone) {
  EXPECT_FALSE(
      Find([](int, int, int y) { return y < 20 || y >= kH - 20 ? 0.6 : 6.0; }).has_value());
}

}  // namespace
}  // namespace litags
