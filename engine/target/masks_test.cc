// Statistics of photos with masks are those of the photos without what is masked.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "engine/core/mask.h"
#include "engine/core/rng.h"
#include "engine/prior/structure_prior.h"
#include "engine/target/information.h"
#include "engine/target/photometric.h"
#include "engine/target/tone.h"

namespace litags {
namespace {

constexpr int kWidth = 64, kHeight = 48, kCut = 40;  // columns that count

// A photo twice: as wide as what counts, and with a bright, noisy rest under a mask.
struct Pair {
  explicit Pair(int low) : cut(kCut, kHeight), whole(kWidth, kHeight), mask(kWidth, kHeight) {
    const CounterRng rng(7, low);
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        mask.data[size_t(y) * kWidth + x] = x < kCut ? kCounts : 0;
        for (int c = 0; c < 3; ++c) {
          const uint64_t i = (uint64_t(y) * kWidth + x) * 3 + c;
          const int level = x < kCut ? low + (x / 8) * 2 : 180;
          const int noise = x < kCut ? 3 : 70;
          whole.pixel(x, y)[c] = PhotoSample((level + rng.Below(i, noise)) / 255.0f);
          if (x < kCut) cut.pixel(x, y)[c] = whole.pixel(x, y)[c];
        }
      }
    }
  }
  Photo cut, whole;
  PlaneU8 mask;
};

struct Photos {
  Photos() {
    for (const int low : {4, 9, 20}) {
      Pair pair(low);
      cut.push_back(std::move(pair.cut));
      whole.push_back(std::move(pair.whole));
      masks.push_back(std::move(pair.mask));
    }
  }
  std::vector<Photo> cut, whole;
  std::vector<PlaneU8> masks;
};

TEST(MaskedPhotos, GainsOfTargetsAreThoseOfWhatCounts) {
  const Photos photos;
  const std::vector<double> exposures = {1, 1.2, 2};
  for (const Tone rule : {Tone::kPaper, Tone::kCapture}) {
    const auto cut = MakeTargets(photos.cut, exposures, {.rule = rule}, 1);
    const auto masked =
        MakeTargets(photos.whole, exposures, {.rule = rule}, 1, {.masks = photos.masks});
    const auto whole = MakeTargets(photos.whole, exposures, {.rule = rule}, 1);
    ASSERT_TRUE(cut.ok() && masked.ok() && whole.ok());
    for (size_t i = 0; i < 3; ++i) {
      EXPECT_DOUBLE_EQ((*masked)[i].gain, (*cut)[i].gain);
      EXPECT_LT((*whole)[i].gain, 0.9 * (*cut)[i].gain) << "the rest makes no difference here";
      EXPECT_EQ((*masked)[i].image.pixel(3, 5)[1], (*cut)[i].image.pixel(3, 5)[1]);
    }
  }
}

TEST(MaskedPhotos, ExposuresAreThoseOfWhatCounts) {
  const Photos photos;
  const auto cut = RelativeExposures(photos.cut, {});
  const auto masked = RelativeExposures(photos.whole, {}, photos.masks);
  for (size_t i = 0; i < 3; ++i) EXPECT_DOUBLE_EQ(masked[i], cut[i]);
  // Enough sightings, each with a masked pixel in its patch, are none.
  std::vector<PointSighting> sightings;
  for (int point = 0; point < 2 * kMinSightings; ++point) {
    for (int i = 0; i < 3; ++i) sightings.push_back({point, i, kCut + 1.5, 5.5 + point % 30});
  }
  EXPECT_EQ(RelativeExposures(photos.whole, sightings, photos.masks), masked);
  EXPECT_NE(RelativeExposures(photos.whole, sightings), masked);
}

TEST(MaskedPhotos, NoiseAndScaleOfStructureAreThoseOfWhatCounts) {
  const Photos photos;
  EXPECT_DOUBLE_EQ(IntensityNoise(photos.whole[0], photos.masks[0]), IntensityNoise(photos.cut[0]));
  EXPECT_DOUBLE_EQ(IntensityFloor(photos.whole, 1, photos.masks), IntensityFloor(photos.cut, 1));
  std::vector<Photo> filled = photos.whole;
  for (size_t i = 0; i < 3; ++i) FillMasked(photos.masks[i], &filled[i]);
  const auto cut = ComputeCapturePriors(photos.cut, 1, CancelToken());
  const auto masked = ComputeCapturePriors(filled, 1, CancelToken(), photos.masks);
  const auto whole = ComputeCapturePriors(photos.whole, 1, CancelToken());
  ASSERT_TRUE(cut.ok() && masked.ok() && whole.ok());
  // The filter sees filled pixels at the border of the mask where the cut photo is mirrored.
  EXPECT_NEAR(masked->scale, cut->scale, 0.05 * cut->scale);
  EXPECT_GT(std::abs(whole->scale - cut->scale), 0.1 * cut->scale);
}

TEST(MaskedPhotos, InformationIsThatOfWhatCounts) {
  Photo flat(kWidth, kHeight);
  std::fill(flat.data.begin(), flat.data.end(), PhotoSample(0.4f));
  Photo noisy = flat;  // but for an eighth
  PlaneU8 mask(kWidth, kHeight);
  const CounterRng rng(5, 1);
  for (int y = 0; y < kHeight; ++y) {
    std::fill_n(&mask.data[size_t(y) * kWidth], kWidth / 8, kCounts);
    for (int i = 3 * kWidth / 8; i < 3 * kWidth; ++i) {
      noisy.pixel(0, y)[i] =
          PhotoSample(static_cast<float>(0.4 + 0.1 * rng.Normal(uint64_t(y) * 3 * kWidth + i)));
    }
  }
  const auto weights = InformationWeights({&flat, &flat}, {&flat, &noisy}, {1, 4}, {mask, mask});
  const auto unmasked = InformationWeights({&flat, &flat}, {&flat, &noisy}, {1, 4});
  EXPECT_EQ(weights[1].data[5], kInformationOne);
  EXPECT_LT(unmasked[1].data[5], unmasked[0].data[5] / 2);
}

TEST(MaskedPhotos, InformationHasAMeanOfOneWhereItCounts) {
  const Photos photos;
  std::vector<const Photo*> whole;
  for (const Photo& photo : photos.whole) whole.push_back(&photo);
  const auto weights = InformationWeights(whole, whole, {1, 1, 4}, photos.masks);
  ASSERT_EQ(weights.size(), 3u);
  double sum = 0, count = 0;
  for (size_t i = 0; i < 3; ++i) {
    ForCounted(photos.masks[i], weights[i].data.size(), [&](size_t k) {
      sum += weights[i].data[k];
      ++count;
    });
  }
  EXPECT_NEAR(sum / count / kInformationOne, 1, 0.02);
}

}  // namespace
}  // namespace litags
