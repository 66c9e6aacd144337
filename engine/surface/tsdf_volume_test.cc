#include "engine/surface/tsdf_volume.h"

#include <gtest/gtest.h>

#include "engine/surface/surface_test_util.h"

namespace litags {
namespace {

TsdfVolume Fused(const std::vector<SurfacePicture>& pictures, const TsdfOptions& options = {}) {
  TsdfVolume volume;
  const absl::Status status = volume.Fuse(pictures, options);
  EXPECT_TRUE(status.ok()) << status;
  return volume;
}

TEST(TsdfVolume, DistancesHaveTheSignOfTheSide) {
  const TsdfVolume volume = Fused(FourPictures());
  ASSERT_GT(volume.num_blocks(), 100u);
  int compared = 0;
  for (size_t b = 0; b < volume.num_blocks(); ++b) {
    const auto block = volume.block(b);
    EXPECT_EQ(volume.FindBlock(block), static_cast<int64_t>(b));
    for (int i = 0; i < TsdfVolume::kVoxels; ++i) {
      const Voxel& voxel = volume.voxels(b)[i];
      if (voxel.near < 4) continue;
      const auto p =
          volume.PointOf({8 * block[0] + i % 8, 8 * block[1] + i / 8 % 8, 8 * block[2] + i / 64});
      // Along slanted rays distances are longer, never shorter; half a voxel for interpolation.
      const double inside = kRadius - std::hypot(p[0], p[1], p[2]);
      if (std::abs(inside) > volume.voxel_side() / 2 && p[2] < 1.5) {
        EXPECT_EQ(voxel.distance() < 0, inside > 0);
        ++compared;
      }
    }
  }
  EXPECT_GT(compared, 500);
}

TEST(TsdfVolume, VoxelsGrowUntilTheyFitTheMemory) {
  TsdfOptions options;
  const TsdfVolume fine = Fused(FourPictures());
  options.most_bytes = size_t{100} * TsdfVolume::kVoxels * sizeof(Voxel);
  const TsdfVolume coarse = Fused(FourPictures(), options);
  EXPECT_GT(fine.num_blocks(), 100u);
  EXPECT_LE(coarse.num_blocks(), 100u);
  EXPECT_GT(coarse.num_blocks(), 40u);
  EXPECT_GT(coarse.voxel_side(), 1.2 * fine.voxel_side());
}

TEST(TsdfVolume, WithoutKnownPixelsThereIsNothing) {
  SurfacePicture picture = PictureFrom({0, 0, -3});
  std::fill(picture.depth.data.begin(), picture.depth.data.end(), 0.0f);
  EXPECT_EQ(Fused({picture}).num_blocks(), 0u);
  EXPECT_EQ(Fused({}).num_blocks(), 0u);
}

TEST(TsdfVolumeDeathTest, MorePicturesThanAVoxelCountsAreRefused) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  std::vector<SurfacePicture> pictures(TsdfVolume::kMostPictures);
  EXPECT_EQ(Fused(pictures).num_blocks(), 0u);
  pictures.emplace_back();
  EXPECT_DEATH(Fused(pictures), "kMostPictures");
}

TEST(TsdfVolume, CancelledSoon) {
  TsdfOptions options;
  options.cancel.Cancel();
  TsdfVolume volume;
  EXPECT_EQ(volume.Fuse(FourPictures(), options).code(), absl::StatusCode::kCancelled);
}

}  // namespace
}  // namespace litags
