#include "engine/sfm/registration.h"

#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
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

std::string ReasonOf(const SfmRung& rung, int photos) {
  const absl::Status status = JudgeRegistration(rung, std::vector<SfmPhoto>(photos), SfmOptions());
  return status.ok() ? "" : GetErrorDetail(status)->reason;
}

TEST(Registration, ACameraThatTurnedIsNamedWhateverCameOut) {
  SfmRung split;
  split.registered = 4;
  split.groups = {4, 3};
  EXPECT_EQ(ReasonOf(split, 14), "SFM_SPLIT");
  split.turned = true;
  EXPECT_EQ(ReasonOf(split, 14), "SFM_NO_PARALLAX");
  SfmRung placed;
  placed.registered = 14;
  placed.groups = {14};
  EXPECT_EQ(ReasonOf(placed, 14), "");
  placed.turned = true;
  EXPECT_EQ(ReasonOf(placed, 14), "SFM_NO_PARALLAX");
}

// Groups stand in the order of their models, which may share photos with earlier ones.
TEST(Registration, TheSecondLargestGroupTellsASplitWhereverItStands) {
  SfmRung split;
  split.registered = 40;
  split.groups = {40, 5, 24};
  EXPECT_EQ(ReasonOf(split, 69), "SFM_SPLIT");
  split.groups = {40, 5, 19};
  EXPECT_EQ(ReasonOf(split, 64), "");
}

TEST(Registration, SizesOfOneLensThatDifferAreNamed) {
  const auto photo = [](const char* camera, int width, int height) {
    PhotoFile file;
    file.camera = camera;
    file.width = width;
    file.height = height;
    return file;
  };
  EXPECT_EQ(SummarizeSharedSizes({photo("a", 300, 200), photo("b", 640, 480)}), "");
  EXPECT_EQ(SummarizeSharedSizes({photo("a", 301, 200), photo("b", 640, 480), photo("a", 298, 203),
                                  photo("a", 299, 199)}),
            "photos of 298x203 to 301x200 px, which differ by little, share a lens");
}

}  // namespace
}  // namespace litags
