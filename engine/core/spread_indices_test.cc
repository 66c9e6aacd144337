#include "engine/core/spread_indices.h"

#include <gtest/gtest.h>

#include <vector>

namespace litags {
namespace {

TEST(SpreadIndices, AllOfFewInTheirOrder) {
  EXPECT_TRUE(SpreadIndices(0, 64).empty());
  EXPECT_TRUE(SpreadIndices(5, 0).empty());
  EXPECT_EQ(SpreadIndices(4, 64), (std::vector<size_t>{0, 1, 2, 3}));
  EXPECT_EQ(SpreadIndices(4, 4), (std::vector<size_t>{0, 1, 2, 3}));
}

TEST(SpreadIndices, SomeOfManyLeaveNoLongGap) {
  for (const size_t count : {33, 64, 65, 100, 384, 1000, 5000}) {
    for (const size_t most : {1, 32, 64}) {
      if (count <= most) continue;
      const std::vector<size_t> some = SpreadIndices(count, most);
      ASSERT_EQ(some.size(), most);
      for (size_t i = 1; i < most; ++i) {
        EXPECT_GT(some[i], some[i - 1]);
        EXPECT_LE(double(some[i] - some[i - 1]), 3.0 * count / most) << count << " " << most;
      }
    }
  }
}

// Of the six views of each panorama, sorted by name, the index modulo 6 is the direction. Rigs have
// other numbers of cameras.
TEST(SpreadIndices, EveryDirectionOfAPanoramaOrRigIsAmongThem) {
  for (const size_t period : {2, 3, 4, 5, 6}) {
    for (const size_t places : {20, 31, 32, 64, 100, 640}) {
      for (const size_t most : {32, 64}) {
        if (period * places <= most) continue;
        std::vector<int> views(period);
        for (const size_t i : SpreadIndices(period * places, most)) ++views[i % period];
        for (const int n : views) {
          EXPECT_GE(n, static_cast<int>(most / period / 2))
              << period << " " << places << " " << most;
        }
      }
    }
  }
}

}  // namespace
}  // namespace litags
