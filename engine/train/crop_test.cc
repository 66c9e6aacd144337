#include "engine/train/crop.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "engine/train/train_test_util.h"

namespace litags {
namespace {

TEST(CropGrid, CutsLargePhotosAloneIntoAboutSquareCells) {
  const auto cells = [](int width, int height, int64_t pixels) {
    const CropGrid grid(width, height, pixels);
    return std::pair(grid.columns, grid.rows);
  };
  EXPECT_EQ(cells(1600, 1063, 200'000), std::pair(4, 2));
  EXPECT_EQ(cells(1063, 1600, 200'000), std::pair(2, 4));
  EXPECT_EQ(cells(4032, 3024, 200'000), std::pair(9, 7));
  EXPECT_EQ(cells(270, 480, 200'000), std::pair(1, 1));
  EXPECT_EQ(cells(640, 480, 200'000), std::pair(1, 1));
  EXPECT_EQ(cells(1600, 1063, 0), std::pair(1, 1));
}

TEST(DrawCrop, EveryCellComesOnceBeforeAnyComesAgain) {
  const CropGrid grid(12000, 6000, 9000000);  // 4 x 2
  ASSERT_EQ(grid.cells(), 8);
  for (int round = 0; round < 20; ++round) {
    std::vector<int> seen(grid.cells());
    for (int i = 0; i < grid.cells(); ++i) {
      const PixelRect crop = DrawCrop(grid, /*seed=*/7, /*photo=*/3, round * grid.cells() + i);
      // Outer cells keep their outer line; the second column begins at 1500 to 4500, the third
      // after.
      const int inner = crop.x < 4500 ? 1 : 2;
      const int column = crop.x == 0 ? 0 : crop.x + crop.width == 12000 ? 3 : inner;
      ++seen[(crop.y == 0 ? 0 : 4) + column];
    }
    EXPECT_EQ(seen, std::vector<int>(grid.cells(), 1));
  }
}

TEST(DrawCrop, EveryPixelIsAsLikelyAsAnother) {
  const CropGrid grid(61, 41, 450);  // 3 x 2
  ASSERT_EQ(grid.cells(), 6);
  constexpr int kVisits = 6000;
  std::vector<int> seen(61 * 41);
  for (int visit = 0; visit < kVisits; ++visit) {
    const PixelRect crop = DrawCrop(grid, 1, 0, visit);
    ASSERT_GE(crop.x, 0);
    ASSERT_GE(crop.y, 0);
    ASSERT_GT(crop.width, 0);
    ASSERT_GT(crop.height, 0);
    ASSERT_LE(crop.x + crop.width, 61);
    ASSERT_LE(crop.y + crop.height, 41);
    for (int y = crop.y; y < crop.y + crop.height; ++y) {
      for (int x = crop.x; x < crop.x + crop.width; ++x) ++seen[y * 61 + x];
    }
  }
  // Binomial: 1000 +- 29; pixels share their fate with their neighbours, so there are few tries.
  const auto [least, most] = std::minmax_element(seen.begin(), seen.end());
  EXPECT_GT(*least, 1000 - 6 * 29);
  EXPECT_LT(*most, 1000 + 6 * 29);
}

TEST(DrawCrop, DependsOnSeedPhotoAndVisit) {
  const CropGrid grid(4000, 3000, 200'000);
  const auto draw = [&](uint64_t seed, size_t photo, uint64_t visit) {
    const PixelRect crop = DrawCrop(grid, seed, photo, visit);
    return std::vector<int>{crop.x, crop.y, crop.width, crop.height};
  };
  EXPECT_EQ(draw(1, 2, 3), draw(1, 2, 3));
  EXPECT_NE(draw(1, 2, 3), draw(2, 2, 3));
  EXPECT_NE(draw(1, 2, 3), draw(1, 3, 3));
  EXPECT_NE(draw(1, 2, 3), draw(1, 2, 4));
}

TEST(CropView, HasThePixelsOfTheRectangle) {
  TrainView view = DarkViews(ColoredCloud(50, 1), 1, 48, 32)[0];
  view.mask = PlaneU8(48, 32);
  for (size_t i = 0; i < view.mask.data.size(); ++i) view.mask.data[i] = i % 5 == 0 ? 0 : 255;
  const PixelRect crop{11, 5, 20, 13};
  TrainView out;
  CropView(view, crop, 1, &out);
  ASSERT_EQ(out.photo.width, 20);
  ASSERT_EQ(out.photo.height, 13);
  ASSERT_TRUE(out.depth.has_value());
  EXPECT_TRUE(out.information.empty());
  EXPECT_EQ(out.view.camera.width, 48) << "the camera stays the photo's";
  for (int y = 0; y < 13; ++y) {
    for (int x = 0; x < 20; ++x) {
      const size_t from = size_t(5 + y) * 48 + 11 + x, to = size_t(y) * 20 + x;
      for (int c = 0; c < 3; ++c) {
        ASSERT_EQ(out.photo.data[3 * to + c], view.photo.data[3 * from + c]);
        ASSERT_EQ(out.target.data[3 * to + c], view.target.data[3 * from + c]);
      }
      ASSERT_EQ(out.structure.data[to], view.structure.data[from]);
      ASSERT_EQ(out.mask.data[to], view.mask.data[from]);
      ASSERT_EQ(out.depth->depth.data[to], view.depth->depth.data[from]);
    }
  }
  // A view without some of the images leaves nothing of the last one behind.
  view.mask = PlaneU8();
  view.depth.reset();
  CropView(view, crop, 1, &out);
  EXPECT_TRUE(out.mask.empty());
  EXPECT_FALSE(out.depth.has_value());
}

}  // namespace
}  // namespace litags
