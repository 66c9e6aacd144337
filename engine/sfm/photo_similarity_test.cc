#include "engine/sfm/photo_similarity.h"

#include <vector>

#include "engine/sfm/walk_test_util.h"
#include "gtest/gtest.h"

namespace litags {
namespace {

std::vector<absl::Span<const uint8_t>> Spans(const std::vector<std::vector<uint8_t>>& photos) {
  return {photos.begin(), photos.end()};
}

TEST(CompareCoarseFeatures, CountsTheFeaturesThatPhotosShare) {
  const std::vector<std::vector<uint8_t>> photos = {
      PhotoOfFeatures(0, 40), PhotoOfFeatures(30, 40), PhotoOfFeatures(100, 40), {}};
  const PhotoSimilarity similarity = CompareCoarseFeatures(Spans(photos), 1, CancelToken());
  EXPECT_EQ(similarity.num_photos(), 4);
  EXPECT_EQ(similarity.At(0, 1), 10);
  EXPECT_EQ(similarity.At(1, 0), 10);
  EXPECT_EQ(similarity.At(0, 2), 0);
  EXPECT_EQ(similarity.At(0, 3), 0);
  EXPECT_EQ(similarity.At(0, 0), 0);
}

TEST(CompareCoarseFeatures, ComparesTheLastFeaturesOnly) {
  const int coarse = static_cast<int>(kCoarseFeatures);
  const std::vector<std::vector<uint8_t>> photos = {
      PhotoOfFeatures(0, 50 + coarse), PhotoOfFeatures(0, 50), PhotoOfFeatures(50, coarse)};
  const PhotoSimilarity similarity = CompareCoarseFeatures(Spans(photos), 1, CancelToken());
  EXPECT_EQ(similarity.At(0, 1), 0);  // what they share is fine in photo 0
  EXPECT_EQ(similarity.At(0, 2), coarse);
}

TEST(CompareCoarseFeatures, TheNumberOfThreadsChangesNothing) {
  const std::vector<std::vector<uint8_t>> photos = PhotosOfAWalk(30);
  const PhotoSimilarity one = CompareCoarseFeatures(Spans(photos), 1, CancelToken());
  const PhotoSimilarity three = CompareCoarseFeatures(Spans(photos), 3, CancelToken());
  for (int i = 0; i < 30; ++i) {
    for (int j = 0; j < 30; ++j) EXPECT_EQ(one.At(i, j), three.At(i, j));
  }
}

}  // namespace
}  // namespace litags
