#include "engine/sfm/colmap.h"

#include "gtest/gtest.h"

namespace litags {
namespace {

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

}  // namespace
}  // namespace litags
