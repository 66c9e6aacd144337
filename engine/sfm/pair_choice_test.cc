#include "engine/sfm/pair_choice.h"

#include <algorithm>
#include <numeric>
#include <vector>

#include "engine/core/rng.h"
#include "engine/sfm/walk_test_util.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace litags {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::IsSupersetOf;
using ::testing::Not;
using ::testing::SizeIs;
using ::testing::UnorderedElementsAreArray;

using Photos = std::vector<std::vector<uint8_t>>;

SfmOptions LargeCapture() {
  SfmOptions options;
  options.match_all_up_to = 9;
  options.similar_photos = 3;
  options.threads = 1;
  return options;
}

std::vector<PhotoPair> Pairs(const SfmOptions& options, const Photos& photos) {
  return PairsToMatch(options, photos, CancelToken());
}

// Positions 0, 1, ... mixed, no longer in the order of a walk.
std::vector<int> Shuffled(int count) {
  std::vector<int> order(count);
  std::iota(order.begin(), order.end(), 0);
  const CounterRng rng(5, 1);
  std::sort(order.begin(), order.end(), [&](int a, int b) { return rng.Bits(a) < rng.Bits(b); });
  return order;
}

bool Joins(const std::vector<PhotoPair>& pairs, int num_photos) {
  std::vector<int> group(num_photos);
  std::iota(group.begin(), group.end(), 0);
  for (const PhotoPair& pair : pairs) {
    std::replace(group.begin(), group.end(), int{group[pair.second]}, int{group[pair.first]});
  }
  return std::count(group.begin(), group.end(), group[0]) == num_photos;
}

// Similarity of photos on a line: the nearer, the more alike; photos `sight` apart share nothing.
PhotoSimilarity Line(int num_photos, int sight) {
  PhotoSimilarity similarity(num_photos);
  for (const PhotoPair& pair : AllPairs(num_photos)) {
    similarity.Set(pair.first, pair.second, std::max(0, sight - (pair.second - pair.first)));
  }
  return similarity;
}

TEST(PairsToMatch, AreAllPairsOfASmallCapture) {
  EXPECT_THAT(Pairs({}, {}), IsEmpty());
  EXPECT_THAT(Pairs({}, Photos(1)), IsEmpty());
  EXPECT_THAT(Pairs({}, Photos(3)), ElementsAre(PhotoPair{0, 1}, PhotoPair{0, 2}, PhotoPair{1, 2}));
  EXPECT_THAT(Pairs({}, Photos(200)), SizeIs(200 * 199 / 2));
  EXPECT_THAT(Pairs({}, Photos(201)), SizeIs(testing::Lt(201 * 30)));
}

TEST(PairsByContent, AreTheSameWhateverTheNames) {
  Photos walk = PhotosOfAWalk(40);
  for (int i = 20; i < 25; ++i)
    walk[i].resize(10 * kDescriptorSize);  // equally alike, or not at all
  const std::vector<int> photo_at = Shuffled(40);
  Photos shuffled;
  for (const int i : photo_at) shuffled.push_back(walk[i]);
  std::vector<PhotoPair> pairs = PairsByContent(LargeCapture(), shuffled, CancelToken());
  for (PhotoPair& pair : pairs) {
    const auto [first, second] = std::minmax(photo_at[pair.first], photo_at[pair.second]);
    pair = {first, second};
  }
  EXPECT_THAT(pairs,
              UnorderedElementsAreArray(PairsByContent(LargeCapture(), walk, CancelToken())));
}

TEST(PairsByContent, JoinTheSceneThoughNoPhotosMostSimilarOnesDo) {
  // Two places, where all photos are alike, and one photo of each that shares three features.
  Photos photos;
  for (int i = 0; i < 20; ++i) photos.push_back(PhotoOfFeatures(i < 10 ? 0 : 500, 40 + i % 10));
  photos[4] = PhotoOfFeatures(0, 53);
  photos[15] = PhotoOfFeatures(50, 40);
  EXPECT_THAT(PairsByContent(LargeCapture(), photos, CancelToken()), Contains(PhotoPair{4, 15}));
}

TEST(PairsToMatch, TheNumberOfThreadsChangesNothing) {
  SfmOptions options = LargeCapture();
  const auto one = Pairs(options, PhotosOfAWalk(40));
  options.threads = 3;
  EXPECT_EQ(Pairs(options, PhotosOfAWalk(40)), one);
}

TEST(PairsToMatch, HaveEachPhotosNeighboursByName) {
  // Photos that show nothing are joined to those beside them.
  Photos photos = PhotosOfAWalk(12);
  photos[5].clear();
  const auto pairs = Pairs(LargeCapture(), photos);
  EXPECT_THAT(pairs, IsSupersetOf({PhotoPair{3, 5}, PhotoPair{4, 5}, PhotoPair{5, 6}}));
}

TEST(SimilarPairs, AreTheNearestAndSomeFartherOnes) {
  std::vector<int> of_first;
  for (const PhotoPair& pair : SimilarPairs(Line(40, 30), 3)) {
    EXPECT_LT(pair.first, pair.second);
    if (pair.first == 0) of_first.push_back(pair.second);
  }
  // Ranks 0, 1, 2, then 6, 12, 24; rank 48 is none of 40.
  EXPECT_THAT(of_first, IsSupersetOf({1, 2, 3, 7, 13, 25}));
  EXPECT_THAT(of_first, Not(Contains(5)));
  EXPECT_THAT(of_first, Not(Contains(testing::Gt(29)))) << "photos that share nothing";
}

TEST(SimilarPairs, OfFewPhotosAreAllPairs) {
  EXPECT_EQ(SimilarPairs(Line(4, 10), 3), AllPairs(4));
  EXPECT_THAT(SimilarPairs(Line(1, 10), 3), IsEmpty());
  EXPECT_THAT(SimilarPairs(PhotoSimilarity(0), 3), IsEmpty());
}

TEST(SpanningPairs, JoinAllPhotosByTheMostSimilarOnes) {
  PhotoSimilarity two_places(6);
  for (const int first : {0, 3}) {
    two_places.Set(first, first + 1, 20);
    two_places.Set(first + 1, first + 2, 10);
    two_places.Set(first, first + 2, 5);
  }
  two_places.Set(1, 5, 2);
  two_places.Set(0, 4, 1);
  EXPECT_THAT(SpanningPairs(two_places),
              ElementsAre(PhotoPair{0, 1}, PhotoPair{1, 2}, PhotoPair{1, 5}, PhotoPair{3, 4},
                          PhotoPair{4, 5}));
  EXPECT_TRUE(Joins(SpanningPairs(two_places), 6));
  EXPECT_FALSE(Joins(SimilarPairs(two_places, 2), 6)) << "so they are needed";
}

TEST(SpanningPairs, JoinPhotosThatShareNothing) {
  EXPECT_TRUE(Joins(SpanningPairs(PhotoSimilarity(7)), 7));
  EXPECT_THAT(SpanningPairs(PhotoSimilarity(7)), SizeIs(6));
  EXPECT_THAT(SpanningPairs(PhotoSimilarity(1)), IsEmpty());
  EXPECT_THAT(SpanningPairs(PhotoSimilarity(0)), IsEmpty());
}

}  // namespace
}  // namespace litags
