#include "engine/core/limits.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "engine/core/error.h"

namespace litags {
namespace {

using ::testing::HasSubstr;

TEST(CheckPhotoCount, SaysHowManyThereAreAndHowManyAreNeeded) {
  EXPECT_TRUE(CheckPhotoCount(kMinPhotos, kMinPhotos).ok());
  const absl::Status two = CheckPhotoCount(2, 2);
  EXPECT_EQ(two.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(GetErrorDetail(two)->reason, "TOO_FEW_PHOTOS");
  EXPECT_EQ(GetErrorDetail(two)->field, "images");
  EXPECT_THAT(std::string(two.message()), HasSubstr("images: 2 photos; a scene needs at least 3"));
  EXPECT_THAT(std::string(CheckPhotoCount(1, 1).message()), HasSubstr("images: 1 photo;"));
  EXPECT_THAT(std::string(CheckPhotoCount(1, 9).message()),
              HasSubstr("images: 1 of 9 photos have a camera and show something;"));
}

}  // namespace
}  // namespace litags
