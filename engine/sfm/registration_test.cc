#include "engine/sfm/registration.h"

#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "gtest/gtest.h"

namespace litags {
namespace {

TEST(Registration, NeedsAFractionAndAtLeastThree) {
  SfmOptions options;
  options.min_registered = 0.7;
  EXPECT_EQ(NeededPhotos(10, options), 7);  // 0.7 * 10 is 7.000...01 in floating point or not
  EXPECT_EQ(NeededPhotos(4, options), 3);
  EXPECT_EQ(NeededPhotos(2, options), 2);
}

TEST(Registration, LongListsOfNamesAreCut) {
  std::vector<SfmPhoto> photos;
  for (int i = 0; i < 8; ++i) {
    SfmPhoto& photo = photos.emplace_back();
    photo.name = absl::StrCat(i, ".jpg");
    photo.drop = DropCause::kNoMatches;
  }
  EXPECT_EQ(SummarizeDrops(photos),
            "8 match no other photo (0.jpg, 1.jpg, 2.jpg, 3.jpg, 4.jpg, 3 more)");
}

}  // namespace
}  // namespace litags
