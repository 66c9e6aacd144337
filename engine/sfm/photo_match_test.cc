#include "engine/sfm/photo_match.h"

#include <fstream>
#include <string>

#include "engine/core/error.h"
#include "engine/sfm/colmap_database.h"
#include "engine/sfm/fake_colmap.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace litags {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

class MatchPhotosTest : public ::testing::Test {
 protected:
  MatchPhotosTest() {
    options_.threads = 1;
    // Two sizes, and ids against the order of the photos, as several threads leave them.
    colmap_.SetDatabase({"9x9/000002.png", "9x9/000000.png", "5x9/000001.png"}, 40, {});
  }

  void SetUp() override {
    const absl::Status numbered =
        NumberImages(colmap_.database(), {"9x9/000000.png", "5x9/000001.png", "9x9/000002.png"});
    ASSERT_TRUE(numbered.ok()) << numbered;
  }

  absl::StatusOr<std::vector<NamePair>> Match() {
    return MatchPhotos(colmap_.database(), options_, cancel_, [this](double fraction) {
      fractions_.push_back(fraction);
      if (cancel_at_first_) cancel_.Cancel();
    });
  }

  void ExpectDamaged(const std::string& problem) {
    const absl::Status status = Match().status();
    EXPECT_EQ(status.code(), absl::StatusCode::kInternal);
    const auto detail = GetErrorDetail(status);
    EXPECT_EQ(detail ? detail->reason : "", "COLMAP_DATABASE");
    EXPECT_THAT(std::string(status.message()), HasSubstr(problem));
  }

  FakeColmap colmap_;
  SfmOptions options_;
  CancelToken cancel_;
  bool cancel_at_first_ = false;
  std::vector<double> fractions_;
};

TEST_F(MatchPhotosTest, StoresThePairsOfEachPhotoWithLaterOnes) {
  const auto pairs = Match();
  ASSERT_TRUE(pairs.ok()) << pairs.status();
  ASSERT_THAT(*pairs, SizeIs(3));
  EXPECT_EQ((*pairs)[0].name1, "9x9/000000.png");
  EXPECT_EQ((*pairs)[0].name2, "5x9/000001.png");
  EXPECT_EQ((*pairs)[1].name2, "9x9/000002.png");
  EXPECT_THAT(fractions_, ElementsAre(1 / 3.0, 2 / 3.0, 1));

  const auto stored = ReadMatches(colmap_.database());
  ASSERT_TRUE(stored.ok()) << stored.status();
  ASSERT_THAT(*stored, SizeIs(3));
  EXPECT_EQ((*stored)[0].id1, 1);
  EXPECT_EQ((*stored)[0].id2, 2);
  ASSERT_THAT((*stored)[0].matches, SizeIs(40));
  EXPECT_EQ((*stored)[0].matches[39], (FeatureMatch{39, 39}));
}

TEST_F(MatchPhotosTest, ColumnsFollowTheImageIds) {
  // The features of photo 0 are the last 20 of the others.
  colmap_.Execute(
      "UPDATE keypoints SET rows = 20 WHERE image_id = 1;"
      "UPDATE descriptors SET rows = 20, data = substr(data, 20 * 128 + 1) WHERE image_id = 1");
  ASSERT_TRUE(Match().ok());
  const auto stored = ReadMatches(colmap_.database());
  ASSERT_TRUE(stored.ok()) << stored.status();
  EXPECT_EQ((*stored)[0].id1, 1);
  EXPECT_EQ((*stored)[0].matches[0], (FeatureMatch{0, 20}));
}

TEST_F(MatchPhotosTest, TheNumberOfThreadsChangesNothing) {
  ASSERT_TRUE(Match().ok());
  const auto one = ReadMatches(colmap_.database());
  options_.threads = 3;
  ASSERT_TRUE(Match().ok());
  const auto three = ReadMatches(colmap_.database());
  ASSERT_TRUE(one.ok() && three.ok());
  ASSERT_EQ(one->size(), three->size());
  for (size_t i = 0; i < one->size(); ++i) EXPECT_EQ((*one)[i].matches, (*three)[i].matches);
}

TEST_F(MatchPhotosTest, PhotosWithoutFeaturesMatchNothing) {
  colmap_.Execute(
      "DELETE FROM keypoints WHERE image_id = 1; DELETE FROM descriptors WHERE image_id = 1;"
      "UPDATE keypoints SET rows = 0 WHERE image_id = 2;"
      "UPDATE descriptors SET rows = 0, data = NULL WHERE image_id = 2");
  const auto pairs = Match();
  ASSERT_TRUE(pairs.ok()) << pairs.status();
  EXPECT_THAT(*pairs, IsEmpty());
}

TEST_F(MatchPhotosTest, PairsThatCannotBeVerifiedAreLeftOut) {
  colmap_.Execute(
      "INSERT INTO matches VALUES (7, 1, 2, NULL);"  // of an earlier run
      "UPDATE keypoints SET rows = 14 WHERE image_id = 2;"
      "UPDATE descriptors SET rows = 14, data = substr(data, 1, 14 * 128) WHERE image_id = 2");
  const auto pairs = Match();
  ASSERT_TRUE(pairs.ok()) << pairs.status();
  ASSERT_THAT(*pairs, SizeIs(1));
  EXPECT_EQ((*pairs)[0].name2, "9x9/000002.png");
  EXPECT_THAT(*ReadMatches(colmap_.database()), SizeIs(1));
}

TEST_F(MatchPhotosTest, DamagedDescriptorsAreRefused) {
  colmap_.Execute("UPDATE descriptors SET data = substr(data, 2) WHERE image_id = 1");
  ExpectDamaged("9x9/000000.png");
}

TEST_F(MatchPhotosTest, DescriptorsOfAnotherLengthAreRefused) {
  colmap_.Execute("UPDATE descriptors SET cols = 64 WHERE image_id = 1");
  ExpectDamaged("9x9/000000.png");
}

TEST_F(MatchPhotosTest, DescriptorsThatAreNotThoseOfTheKeypointsAreRefused) {
  colmap_.Execute("UPDATE keypoints SET rows = 39 WHERE image_id = 3");
  ExpectDamaged("has 39 keypoints, but 40 descriptors");
}

TEST_F(MatchPhotosTest, AFileThatIsNoDatabaseIsRefused) {
  colmap_.Execute("DROP TABLE matches");
  ExpectDamaged("no such table: matches");
  std::ofstream(colmap_.database()) << std::string(4096, 'x');
  ExpectDamaged("not a database");
}

TEST_F(MatchPhotosTest, CancellationLeavesTheDatabaseAsItWas) {
  cancel_at_first_ = true;
  EXPECT_EQ(Match().status().code(), absl::StatusCode::kCancelled);
  EXPECT_THAT(fractions_, SizeIs(1));
  EXPECT_THAT(*ReadMatches(colmap_.database()), IsEmpty());
}

}  // namespace
}  // namespace litags
