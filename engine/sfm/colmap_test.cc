#include "engine/sfm/colmap.h"

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "absl/strings/str_cat.h"
#include "engine/sfm/fake_colmap.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace litags {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::SizeIs;
using ::testing::StartsWith;

TEST(FeatureBudget, GivesTheFewerFeaturesTheMorePhotosThereAre) {
  EXPECT_EQ(FeatureBudget({}, 3), 4000);
  EXPECT_EQ(FeatureBudget({}, 50), 2020);
  EXPECT_EQ(FeatureBudget({}, 200), 1000);
  EXPECT_EQ(FeatureBudget({}, 250), 800);
  EXPECT_EQ(FeatureBudget({}, 1000), 500);
  SfmOptions options;
  options.max_features = 700;
  EXPECT_EQ(FeatureBudget(options, 3), 700);
  EXPECT_EQ(FeatureBudget(options, 1000), 700);
}

// Three photos, of which COLMAP finds `features` in each.
class ExtractFeatures : public ::testing::Test {
 protected:
  void Extract(int width, int height, int features) {
    std::vector<PhotoFile> photos(3);
    std::vector<std::string> names;
    for (size_t i = 0; i < photos.size(); ++i) {
      photos[i].copy_name = absl::StrCat("a/", i, ".png");
      photos[i].copy_width = width;
      photos[i].copy_height = height;
      names.push_back(photos[i].copy_name);
    }
    fake_.SetDatabase(names, features, {});
    fake_.Execute("UPDATE keypoints SET rows = 99 WHERE image_id = 2");
    fake_.On("feature_extractor",
             "while read -r name; do note \"$name\"; done < \"$list\"; "
             "echo 'Processed file [1/1]'");
    options_.colmap = fake_.program();
    options_.on_line = [this](std::string_view line) { fake_.Hear(line); };
    options_.max_features = 100;
    const std::string rung = fake_.dir() + "/rung";
    std::filesystem::create_directories(rung);
    Colmap colmap(options_, rung, cancel_);
    const auto seconds = colmap.ExtractFeatures(photos, [&](double f) { progress_.push_back(f); });
    ASSERT_TRUE(seconds.ok()) << seconds.status();
  }

  FakeColmap fake_;
  SfmOptions options_;
  CancelToken cancel_;
  std::vector<double> progress_;
};

// The finest features cost most, and COLMAP leaves them out where there are enough others.
TEST_F(ExtractFeatures, OfLargePhotosHasTheFinestOnlyWhereOthersAreFew) {
  Extract(210, 100, 100);
  const std::vector<std::string> calls = fake_.Calls();
  ASSERT_THAT(calls, SizeIs(6));
  EXPECT_THAT(calls[0], AllOf(StartsWith("feature_extractor"), HasSubstr("first_octave 0")));
  EXPECT_THAT(std::vector(calls.begin() + 1, calls.begin() + 4),
              ElementsAre("a/0.png", "a/1.png", "a/2.png"));
  EXPECT_THAT(calls[4], AllOf(StartsWith("feature_extractor"), HasSubstr("first_octave -1")));
  EXPECT_EQ(calls[5], "a/1.png");
  EXPECT_THAT(progress_, ElementsAre(1, 1));
}

TEST_F(ExtractFeatures, OfSmallPhotosHasTheFinestAtOnce) {
  Extract(128, 96, 100);
  const std::vector<std::string> calls = fake_.Calls();
  ASSERT_THAT(calls, SizeIs(4));
  EXPECT_THAT(calls[0], AllOf(StartsWith("feature_extractor"), HasSubstr("first_octave -1")));
}

}  // namespace
}  // namespace litags
