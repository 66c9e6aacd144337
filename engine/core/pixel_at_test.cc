#include "engine/core/pixel_at.h"

#include <gtest/gtest.h>

#include <cmath>
#include <utility>

namespace litags {
namespace {

TEST(PixelAt, IsThePixelThatHasThePlace) {
  for (const auto& [x, y] : {std::pair{0.0, 0.0}, {3.99, 2.5}, {-0.0, 1.0}, {6.99, 4.99}}) {
    const auto pixel = PixelAt(x, y, 7, 5);
    ASSERT_TRUE(pixel.has_value()) << x << " " << y;
    EXPECT_EQ(pixel->x, std::floor(x));
    EXPECT_EQ(pixel->y, std::floor(y));
  }
}

TEST(PixelAt, IsNoneOutsideAndOfWhatNoIntHolds) {
  for (const double out : {-1e-9, -0.5, 7.0, 2147483648.0, 4294967297.0, 1e300, -1e300,
                           double(INFINITY), -double(INFINITY), double(NAN)}) {
    EXPECT_FALSE(PixelAt(out, 1, 7, 7).has_value()) << out;
    EXPECT_FALSE(PixelAt(1, out, 7, 7).has_value()) << out;
  }
}

}  // namespace
}  // namespace litags
