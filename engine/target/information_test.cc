#include "engine/target/information.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <numeric>

#include "engine/noise/two_halves_test_util.h"

namespace litags {
namespace {

constexpr int kSize = kTwoHalvesSize;

// A bright photo that clips the right half, which a dark one of the same place, an eighth of the
// light, sees; the dark one is noisy on the left.
struct TwoExposures {
  Photo bright = TwoHalves(200, 255), dark = TwoHalves(60, 120);
  Photo bright_target = TwoHalves(100, 180), dark_target = TwoHalves(100, 190, 12, 2);
  std::vector<PlaneU8> Weights(double exposure) const {
    return InformationWeights({&bright, &dark}, {&bright_target, &dark_target}, {exposure, 1});
  }
};

TEST(InformationWeights, PhotosThatKnowAPlaceBetterCountForMore) {
  const TwoExposures photos;
  const std::vector<PlaneU8> planes = photos.Weights(8);
  ASSERT_EQ(planes.size(), 2u);
  const double bright_left = planes[0].data[5], bright_right = planes[0].data[kSize - 5],
               dark_right = planes[1].data[kSize - 5];
  // As bright as what the bright photo knows, in all channels.
  const std::vector<int16_t>& target = photos.dark_target.data;
  size_t i = 0;
  while (std::max({target[3 * i], target[3 * i + 1], target[3 * i + 2]}) > 100 * kPhotoCode) ++i;
  const double dark_left = planes[1].data[i];
  // (1 + (2 / 12)^2) / (1 + (48 / 12)^2) and 1 / (1 + (12 / 12)^2), in steps of 1 / 80.
  EXPECT_NEAR(bright_right / bright_left, 0.06, 0.02);
  EXPECT_NEAR(dark_left / bright_left, 0.5, 0.07);
  EXPECT_NEAR(dark_right / bright_left, 1, 0.02);
  double sum = 0;
  for (const PlaneU8& plane : planes) {
    sum += std::accumulate(plane.data.begin(), plane.data.end(), 0.0);
  }
  EXPECT_NEAR(sum / (2 * kSize * kSize) / kInformationOne, 1, 0.02);
}

TEST(InformationWeights, RoundingTakesInformationAway) {
  // Codes 3, 4 and 5 in broad stripes, a step of which is one of 40 in the target. The bright photo
  // has codes between its stripes'.
  Photo dark(kSize, kSize), bright(kSize, kSize), target(kSize, kSize);
  for (size_t i = 0; i < dark.data.size(); ++i) {
    const int stripe = static_cast<int>((i / 3) % kSize / 40);
    dark.data[i] = PhotoSample((3 + stripe) / 255.0f);
    bright.data[i] = PhotoSample((30 + 10 * stripe) / 255.0f);
    target.data[i] = PhotoSample((40 * (3 + stripe) + 0.25f) / 255);
  }
  const auto ratio = [&](double code_step) {
    const auto planes =
        InformationWeights({&bright, &dark}, {&target, &target}, {10, 1}, {}, {}, code_step);
    return double(planes[1].data[kSize / 2]) / planes[0].data[kSize / 2];
  };
  // The best, of a code between the bright photo's, has a noise of 3.
  EXPECT_NEAR(ratio(1), 1 / (1 + 40 * 40 / 12.0 / (12 * 12)), 0.04);
  EXPECT_EQ(ratio(1 / 257.0), 1);
}

TEST(InformationWeights, PhotosOfLikeExposureAreAllAlike) {
  EXPECT_TRUE(TwoExposures().Weights(1.9).empty());
  EXPECT_FALSE(TwoExposures().Weights(2.1).empty());
  EXPECT_TRUE(InformationWeights({}, {}, {}).empty());
}

TEST(InformationWeights, AreTheSameForAnyThreadsAndNoneOnceCancelled) {
  std::vector<Photo> photos, targets;
  std::vector<const Photo*> photo_of, target_of;
  std::vector<double> exposures;
  for (int i = 0; i < 5; ++i) {
    photos.push_back(TwoHalves(40 + 10 * i, 90 + 30 * i, 3, 1));
    targets.push_back(TwoHalves(80 + i, 150, 9 - i, 2 + i));
    exposures.push_back(1 + i / 2 * 3);
  }
  for (int i = 0; i < 5; ++i) {
    photo_of.push_back(&photos[i]);
    target_of.push_back(&targets[i]);
  }
  const auto weights = [&](int threads, const CancelToken& cancel) {
    return InformationWeights(photo_of, target_of, exposures, {}, {}, 1, threads, cancel);
  };
  const std::vector<PlaneU8> one = weights(1, CancelToken()), three = weights(3, CancelToken());
  ASSERT_EQ(one.size(), 5u);
  ASSERT_EQ(three.size(), 5u);
  for (int i = 0; i < 5; ++i) EXPECT_EQ(one[i].data, three[i].data) << i;
  CancelToken cancel;
  cancel.Cancel();
  EXPECT_TRUE(weights(3, cancel).empty());
}

// A lens that is dark at the corners: what is evened out may lie above white, and was measured.
TEST(InformationWeights, WhatWasMadeBrighterThanWhiteIsNotClipped) {
  const std::array<double, 3> gain = {0.3, 0.3, 0.3};
  const RadialFrame frame = {kSize / 2, kSize / 2, kSize};
  Photo bright = TwoHalves(200, 100);
  ApplyResponse(gain, {}, frame, &bright);
  ASSERT_GT(bright.data[0], kPhotoWhite);
  const Photo dark = TwoHalves(60, 40), target = TwoHalves(180, 120);
  const std::vector<Brightening> brightened = {Brightening(gain, {}, frame), Brightening()};
  const auto planes =
      InformationWeights({&bright, &dark}, {&target, &target}, {8, 1}, {}, brightened);
  ASSERT_EQ(planes.size(), 2u);
  EXPECT_NEAR(planes[0].data[5], planes[0].data[kSize - 5], 0.1 * planes[0].data[5]);
}

TEST(InformationWeights, WhatNoPhotoKnowsWeighsAsMuchAsWhatIsKnown) {
  const Photo photo = TwoHalves(100, 255), target = TwoHalves(100, 250);
  const auto planes = InformationWeights({&photo, &photo}, {&target, &target}, {1, 4});
  ASSERT_EQ(planes.size(), 2u);
  for (const PlaneU8& plane : planes) {
    EXPECT_EQ(plane.data[5], kInformationOne);
    EXPECT_EQ(plane.data[kSize - 5], kInformationOne);
  }
}

}  // namespace
}  // namespace litags
