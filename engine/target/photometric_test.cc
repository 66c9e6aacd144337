#include "engine/target/photometric.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <utility>
#include <vector>

#include "engine/core/color.h"
#include "engine/core/mask.h"
#include "engine/core/rng.h"

namespace litags {
namespace {

constexpr int kSide = 80, kCell = 8, kPoints = 200;

// Photo i shows points [shift i, shift i + 100) of a long wall of grey cells, with `exposure`.
struct Wall {
  std::vector<Photo> photos;
  std::vector<PointSighting> sightings;
};

double Albedo(int point) { return 0.02 + 0.2 * CounterRng(5, 0).Uniform(point); }

// `codes`: the file's codes of white.
Wall MakeWall(const std::vector<double>& exposures,
              const std::function<double(int point)>& light = Albedo, int codes = 255,
              int shift = 30) {
  Wall wall;
  for (int i = 0; i < static_cast<int>(exposures.size()); ++i) {
    Photo photo(kSide, kSide);
    for (int y = 0; y < kSide; ++y) {
      for (int x = 0; x < kSide; ++x) {
        const int point = shift * i + (y / kCell) * (kSide / kCell) + x / kCell;
        const double code = SrgbFromLinear(std::min(1.0, exposures[i] * light(point)));
        const double stored = std::round(codes * code) / codes;
        std::fill_n(photo.pixel(x, y), 3, PhotoSample(static_cast<float>(stored)));
      }
    }
    wall.photos.push_back(std::move(photo));
  }
  for (int point = 0; point < kPoints; ++point) {
    for (int i = 0; i < static_cast<int>(exposures.size()); ++i) {
      const int cell = point - shift * i, columns = kSide / kCell;
      if (cell < 0 || cell >= columns * columns) continue;
      wall.sightings.push_back(
          {point, i, (cell % columns + 0.5) * kCell + 0.5, (cell / columns + 0.5) * kCell + 0.5});
    }
  }
  return wall;
}

void ExpectRatios(const std::vector<double>& have, const std::vector<double>& want,
                  double tolerance) {
  ASSERT_EQ(have.size(), want.size());
  for (size_t i = 1; i < have.size(); ++i) {
    EXPECT_NEAR(have[i] / have[0], want[i] / want[0], tolerance * want[i] / want[0]) << i;
  }
}

TEST(Photometric, FindsTheExposuresWhateverThePhotosShow) {
  const std::vector<double> exposures = {1, 0.5, 2, 1.1, 0.9};
  const Wall wall = MakeWall(exposures);
  // Bytes of dark photos: 1%.
  ExpectRatios(RelativeExposures(wall.photos, wall.sightings), exposures, 0.02);
}

TEST(Photometric, TheMedianPhotoHasExposureOne) {
  const Wall wall = MakeWall({0.25, 1, 4});
  std::vector<double> have = RelativeExposures(wall.photos, wall.sightings);
  std::sort(have.begin(), have.end());
  EXPECT_DOUBLE_EQ(have[1], 1);
}

TEST(Photometric, WrongMatchesDoNotMatter) {
  const std::vector<double> exposures = {1, 0.5, 2, 1.1, 0.9};
  Wall wall = MakeWall(exposures);
  for (size_t i = 0; i < wall.sightings.size(); i += 5) wall.sightings[i].x = kSide - 10;
  ExpectRatios(RelativeExposures(wall.photos, wall.sightings), exposures, 0.1);
}

TEST(Photometric, WithoutCommonPointsTheMediansOfThePhotosCount) {
  std::vector<Photo> photos;
  for (const int code : {40, 80, 160}) {
    ImageU8 photo(8, 8);
    std::fill(photo.data.begin(), photo.data.end(), code);
    photos.push_back(PhotoFromU8(photo));
  }
  std::vector<double> want;
  for (const Photo& photo : photos) want.push_back(LinearTable::Get()(photo.data[0]));
  ExpectRatios(RelativeExposures(photos, {}), want, 1e-6);  // single precision
  EXPECT_TRUE(RelativeExposures({}, {}).empty());
}

// Half of the samples that count are darker: the upper of the two in the middle is taken.
TEST(Photometric, MediansOfPhotosAreThoseOfTheirCountedSamples) {
  std::vector<Photo> photos;
  std::vector<PlaneU8> masks;
  for (const int median : {3000, 400, -7}) {
    Photo photo(5, 5);
    PlaneU8 mask(5, 5);
    for (size_t i = 0; i < photo.data.size(); ++i) {
      photo.data[i] = static_cast<int16_t>(i % 2 == 0 ? median : -20);
    }
    std::fill_n(mask.data.begin(), 24, kCounts);
    std::fill_n(&photo.data[72], 3, 9000);  // does not count
    photos.push_back(std::move(photo));
    masks.push_back(std::move(mask));
  }
  const auto have = RelativeExposures(photos, {}, masks);
  std::vector<double> want;
  for (const int16_t median : {3000, 400, 16}) want.push_back(LinearTable::Get()(median));
  ExpectRatios(have, want, 1e-5);  // single precision; a quarter of a code at least
  EXPECT_EQ(RelativeExposures(photos, {}, masks, {}, 1, /*threads=*/3), have);
  CancelToken cancel;
  cancel.Cancel();
  EXPECT_EQ(RelativeExposures(photos, {}, masks, {}, 1, 3, cancel), (std::vector<double>{1, 1, 1}));
}

TEST(Photometric, BlackAndWhiteSamplesAreLeftOut) {
  // The third photo is three stops over: half of it is clipped, the rest tells its exposure.
  const std::vector<double> exposures = {1, 0.9, 8, 1.1};
  const Wall wall = MakeWall(exposures);
  ExpectRatios(RelativeExposures(wall.photos, wall.sightings), exposures, 0.03);
}

// Sodium lamps: no blue at all.
TEST(Photometric, LightThatLacksAPrimaryTellsExposures) {
  const std::vector<double> exposures = {1, 0.9, 0.25, 1.1};
  Wall wall = MakeWall(exposures);
  for (Photo& photo : wall.photos) {
    for (size_t i = 2; i < photo.data.size(); i += 3) photo.data[i] = 0;
  }
  ExpectRatios(RelativeExposures(wall.photos, wall.sightings), exposures, 0.03);
}

// Too few are known to tell whether the others state the truth; what they show is worse.
TEST(Photometric, WhatPhotosStateServesWhereFewAreKnown) {
  Wall wall = MakeWall({1, 1});
  for (const int code : {0, 1, 2, 4}) {
    ImageU8 dark(kSide, kSide);
    std::fill(dark.data.begin(), dark.data.end(), code);
    wall.photos.push_back(PhotoFromU8(dark));
  }
  const std::vector<double> one(wall.photos.size(), 1.0);
  ExpectRatios(RelativeExposures(wall.photos, wall.sightings, {}, one), one, 0.1);
  // Those that are known contradict each other.
  std::vector<double> edited = one;
  edited[1] = 16;
  const auto have = RelativeExposures(wall.photos, wall.sightings, {}, edited);
  EXPECT_EQ(have, RelativeExposures(wall.photos, wall.sightings));
}

// Photos of which all points are nearly black share none with the others.
TEST(Photometric, WhatPhotosStateServesWhereTheyShareTooFewPoints) {
  double worst_without = 0, worst_with = 0;  // stops
  for (const double dark : {1.0 / 180, 1.0 / 250, 1.0 / 400, 1.0 / 600}) {
    const std::vector<double> exposures = {1, 0.9, 1.1, 1, 0.95, dark};
    const Wall wall = MakeWall(exposures);
    std::vector<double> stated;
    for (size_t i = 0; i < exposures.size(); ++i) {
      // To a third of a stop, in any unit.
      stated.push_back(40 * std::exp2(std::round(3 * std::log2(exposures[i])) / 3));
    }
    const auto error = [&](const std::vector<double>& have) {
      return std::abs(std::log2(have[5] / have[0] / dark));
    };
    const double without = error(RelativeExposures(wall.photos, wall.sightings));
    const double with = error(RelativeExposures(wall.photos, wall.sightings, {}, stated));
    std::printf("%.1f stops under: off by %.2f stops, as it states by %.2f\n", -std::log2(dark),
                without, with);
    worst_without = std::max(worst_without, without);
    worst_with = std::max(worst_with, with);
  }
  EXPECT_GT(worst_without, 0.5);
  EXPECT_LT(worst_with, 1.0 / 3);
}

// Of one exposure, from a dark wall to a bright one: its values are below 256 of 65535.
TEST(Photometric, VeryDarkPhotosOf16BitsTellTheirExposures) {
  const auto light = [](int point) {
    return std::exp2(-14.0 + point / 50.0) * (0.5 + CounterRng(5, 0).Uniform(point));
  };
  const std::vector<double> exposures(10, 1.0);
  const Wall wall = MakeWall(exposures, light, 65535, 10);
  const auto have = RelativeExposures(wall.photos, wall.sightings, {}, {}, 1.0 / 257);
  ExpectRatios(have, exposures, 0.02);
  // As for a file of 8 bits nobody is known: then what they state is.
  EXPECT_GT(RelativeExposures(wall.photos, wall.sightings)[9], 1.2);
  ExpectRatios(RelativeExposures(wall.photos, wall.sightings, {}, exposures), exposures, 1e-9);
}

// Nor does noise make light of black.
TEST(Photometric, PatchesOfNoiseAreNotAboveBlack) {
  const CounterRng rng(4, 1);
  const auto patch = [&](double code, double noise) {
    Photo photo(5, 5);
    for (size_t i = 0; i < photo.data.size(); ++i) {
      photo.data[i] = NearestSample(
          kPhotoCode * static_cast<float>(std::max(0.0, code + noise * rng.Normal(i))));
    }
    return *PatchLightAt(photo, {}, 2.5, 2.5);
  };
  EXPECT_TRUE(AboveBlack(patch(0.3, 0), 1.0 / 257));
  EXPECT_FALSE(AboveBlack(patch(0.3, 0), 1));
  EXPECT_FALSE(AboveBlack(patch(0.01, 0), 1.0 / 257));
  EXPECT_FALSE(AboveBlack(patch(0, 0.5), 1.0 / 257));
  EXPECT_FALSE(AboveBlack(patch(0.3, 0.5), 1.0 / 257));
  EXPECT_TRUE(AboveBlack(patch(1.8, 0.5), 1.0 / 257));
  EXPECT_TRUE(AboveBlack(patch(4, 3), 1));
}

TEST(Photometric, WhatPhotosStateIsOnlyBelievedIfTheOthersStateTheTruth) {
  const std::vector<double> exposures = {1, 0.9, 1.1, 1, 0.95, 1.0 / 400};
  const Wall wall = MakeWall(exposures);
  const auto without = RelativeExposures(wall.photos, wall.sightings);
  // An automatic brightness of each photo afterwards; a unit is no matter; too few that state it.
  EXPECT_EQ(
      RelativeExposures(wall.photos, wall.sightings, {}, std::vector<double>{1, 4, 2, 9, .3, 1}),
      without);
  EXPECT_EQ(
      RelativeExposures(wall.photos, wall.sightings, {}, std::vector<double>{1, 0, 0, 1, 0, .1}),
      without);
  EXPECT_EQ(RelativeExposures(wall.photos, wall.sightings, {}, std::vector<double>(6, 0.0)),
            without);
  // Where points are shared, they count.
  const std::vector<double> stated = {1, 0.9, 1.1, 4, 0.95, 1.0 / 400};
  const auto with = RelativeExposures(wall.photos, wall.sightings, {}, stated);
  EXPECT_NEAR(with[3] / with[0], 1, 0.02);
}

// Points seen by photos of a path: photo i sees points [10 i, 10 i + 60).
std::vector<PointSighting> Path(int photos) {
  std::vector<PointSighting> sightings;
  for (int point = 0; point < 10 * photos + 60; ++point) {
    for (int i = 0; i < photos; ++i) {
      if (point >= 10 * i && point < 10 * i + 60) sightings.push_back({point, i, 0, 0});
    }
  }
  return sightings;
}

// Deviation of the logs of the ratios.
double Deviation(const std::vector<double>& have, const std::vector<double>& want) {
  const double n = static_cast<double>(have.size());
  double sum = 0, squares = 0;
  for (size_t i = 0; i < have.size(); ++i) {
    const double log = std::log(have[i] / want[i]);
    sum += log / n, squares += log * log / n;
  }
  return std::sqrt(squares - sum * sum);
}

constexpr int kWalk = 30;  // photos of a path

// What shutters of a walk did, up to `jitter` either way, and the same with a drift of 0.3 stops.
struct Walk {
  std::vector<double> own, drifting;
};

Walk MakeWalk(double jitter) {
  Walk walk;
  for (int i = 0; i < kWalk; ++i) {
    walk.own.push_back(1 + jitter * (2 * CounterRng(3, 0).Uniform(i) - 1));
    walk.drifting.push_back(walk.own[i] * std::exp2(0.3 * std::sin(0.2 * i)));
  }
  return walk;
}

TEST(Photometric, WhatPhotosBesideEachOtherAgreeOnStays) {
  const Walk walk = MakeWalk(0.1);
  EXPECT_GT(Deviation(walk.drifting, walk.own), 0.12);
  // What is left is the mean of what photos beside each other differ by themselves: of some six of
  // them, whose deviation is 0.06.
  EXPECT_LT(Deviation(WithoutDrift(walk.drifting, Path(kWalk)), walk.own), 0.03);
}

TEST(Photometric, ShuttersThatDifferByAStopHideLittleOfTheDrift) {
  const Walk walk = MakeWalk(0.35);
  EXPECT_LT(Deviation(WithoutDrift(walk.drifting, Path(kWalk)), walk.own), 0.09);
}

TEST(Photometric, APhotoChosenApartSaysNothingOfTheDrift) {
  const Walk walk = MakeWalk(0.1);
  std::vector<double> drifting = walk.drifting;
  drifting[17] *= 32;
  std::vector<double> have = WithoutDrift(drifting, Path(kWalk));
  have[17] /= 32;
  EXPECT_LT(Deviation(have, walk.own), 0.04);
}

TEST(Photometric, ExposuresThatWereChosenPhotoByPhotoStay) {
  // Up to three stops either way.
  std::vector<double> chosen;
  for (int i = 0; i < kWalk; ++i) chosen.push_back(std::exp2((7 * i) % 13 / 2.0 - 3));
  EXPECT_LT(Deviation(WithoutDrift(chosen, Path(kWalk)), chosen), 0.1);
  // Two walks of different light, of which only the ends see the same points.
  std::vector<double> halves(kWalk, 1.0);
  std::fill(halves.begin() + kWalk / 2, halves.end(), 2.5);
  EXPECT_LT(Deviation(WithoutDrift(halves, Path(kWalk)), halves), 0.1);
}

TEST(Photometric, WithoutCommonPointsThereIsNoDrift) {
  const std::vector<double> exposures = {0.9, 1, 1.1};
  const std::vector<double> have = WithoutDrift(exposures, {});
  ExpectRatios(have, exposures, 1e-9);
  EXPECT_TRUE(WithoutDrift({}, {}).empty());
}

}  // namespace
}  // namespace litags
