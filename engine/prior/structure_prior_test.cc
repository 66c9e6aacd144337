#include "engine/prior/structure_prior.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/core/error.h"
#include "engine/core/rng.h"

namespace litags {
namespace {

// A photo with structure at several scales and noise of deviation `noise`, at an exposure.
Photo MakePhoto(int width, int height, double exposure, double noise, uint64_t stream) {
  Planes image(3, height, width);
  const CounterRng rng(11, stream);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      for (int c = 0; c < 3; ++c) {
        const double pattern = 0.5 + 0.2 * std::sin(0.3 * x + c) * std::cos(0.2 * y - c) +
                               (((x / 16) + (y / 16)) % 2 ? 0.2 : 0.0);
        const double v = exposure * pattern + noise * rng.Normal((size_t(y) * width + x) * 3 + c);
        image.at(c, y, x) = static_cast<float>(v);
      }
    }
  }
  return PhotoFromU8(ToImageU8(image));
}

TEST(StructurePrior, DoesNotSeeTheExposure) {
  const Planes photo = ToPlanes(MakePhoto(60, 40, 0.9, 0, 1));
  Planes dark = photo;
  for (float& v : dark.data) v *= 0.07f;
  const auto a = StructurePrior(photo, 1, 0), b = StructurePrior(dark, 1, 0);
  ASSERT_TRUE(a.ok() && b.ok());
  for (size_t i = 0; i < a->data.size(); ++i) {
    ASSERT_NEAR(a->data[i], b->data[i], 2e-5 * (1 + a->data[i]));  // single precision
  }
}

TEST(StructurePrior, OfAFlatPhotoIsZeroAndOfABlackOneToo) {
  for (const float level : {0.0f, 0.3f}) {
    Planes flat(3, 20, 30);
    std::fill(flat.data.begin(), flat.data.end(), level);
    const auto prior = StructurePrior(flat, 1, 0);
    ASSERT_TRUE(prior.ok());
    for (const float p : prior->data) ASSERT_NEAR(p, 0, 1e-6);
  }
}

TEST(StructurePrior, OfATurnedPhotoIsTheTurnedPrior) {
  const Planes photo = ToPlanes(MakePhoto(200, 80, 0.9, 0.02, 1));
  Planes turned(3, 200, 80);
  for (int c = 0; c < 3; ++c) {
    for (int y = 0; y < 200; ++y) {
      for (int x = 0; x < 80; ++x) turned.at(c, y, x) = photo.at(c, x, y);
    }
  }
  const auto a = StructurePrior(photo, 2, 0), b = StructurePrior(turned, 2, 0);
  ASSERT_TRUE(a.ok() && b.ok());
  for (int y = 0; y < 200; ++y) {
    for (int x = 0; x < 80; ++x) ASSERT_NEAR(b->at(0, y, x), a->at(0, x, y), 1e-5);
  }
}

// Of one scene at one scale, whichever way the camera was held.
TEST(PriorSigma, IsThatOfTheLongerSide) {
  EXPECT_EQ(PriorSigma(500, 300), 1);
  EXPECT_EQ(PriorSigma(1000, 300), 2);
  EXPECT_EQ(PriorSigma(300, 1000), 2);
  EXPECT_EQ(PriorSigma(200, 100), 0.5);
}

TEST(StructurePrior, RefusesAPhotoSmallerThanItsKernel) {
  const double sigma = 3;  // radius 10
  EXPECT_TRUE(StructurePrior(Planes(3, 11, 40), sigma, 0).ok());
  const auto small = StructurePrior(Planes(3, 10, 40), sigma, 0);
  ASSERT_FALSE(small.ok());
  EXPECT_EQ(GetErrorDetail(small.status())->reason, "IMAGE_TOO_SMALL");
}

TEST(IntensityNoise, FindsTheNoiseOfE) {
  // E mixes three independent channels: deviation 0.688 of one channel's.
  for (const double noise : {0.01, 0.03}) {
    const double expected = noise * std::sqrt(0.06 * 0.06 + 0.63 * 0.63 + 0.27 * 0.27);
    const double have = IntensityNoise(MakePhoto(200, 160, 0.8, noise, 3));
    EXPECT_GT(have, 0.9 * expected);
    EXPECT_LT(have, 1.4 * expected) << "structure adds some";
  }
}

TEST(IntensityNoise, IsThatOfWhatIsInRangeWhereMostIsBlackOrWhite) {
  const Photo lit = MakePhoto(200, 160, 0.8, 0.03, 3);
  for (const int16_t below : {0, kPhotoWhite}) {
    Photo photo(200, 360);
    std::fill(photo.data.begin(), photo.data.end(), below);
    std::copy(lit.data.begin(), lit.data.end(), photo.data.begin());
    EXPECT_NEAR(IntensityNoise(photo), IntensityNoise(lit), 0.1 * IntensityNoise(lit)) << below;
  }
}

TEST(IntensityNoise, IsNeverBelowTheRoundingOfBytes) {
  const double rounding = 0.688 / (255 * std::sqrt(12.0));
  EXPECT_NEAR(IntensityNoise(Photo(50, 40)), rounding, 0.01 * rounding);
  EXPECT_NEAR(IntensityNoise(Photo(1, 1)), rounding, 0.01 * rounding);
}

TEST(CapturePriors, ShareOneScaleThatClipsOnePercent) {
  std::vector<Photo> photos;
  for (int i = 0; i < 3; ++i) photos.push_back(MakePhoto(120, 90, 0.2 + 0.3 * i, 0.005, i));
  const auto priors = ComputeCapturePriors(photos, 2, CancelToken());
  ASSERT_TRUE(priors.ok()) << priors.status();
  ASSERT_EQ(priors->maps.size(), 3u);
  EXPECT_NEAR(priors->floor, IntensityFloor(photos, 1), 1e-12);
  size_t above = 0, total = 0;
  for (int i = 0; i < 3; ++i) {
    const Planes p = *StructurePrior(ToPlanes(photos[i]), PriorSigma(120, 90), priors->floor);
    for (size_t k = 0; k < p.data.size(); ++k, ++total) {
      above += p.data[k] > priors->scale;
      // Half a step of rounding, and 16 bits of P.
      const double value = std::min(1.0, p.data[k] / priors->scale) * 255;
      ASSERT_NEAR(priors->maps[i].data[k], value, 0.51 + value / 512);
    }
  }
  // 1 % above, and what the 0.2 % resolution of the scale moves.
  EXPECT_NEAR(double(above) / total, 0.01, 0.002);
}

TEST(CapturePriors, OfAPictureAtTwoSizesAreAlike) {
  const auto edge = [](int width, int height) {
    ImageU8 photo(width, height);
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        std::fill_n(photo.pixel(x, y), 3, uint8_t(x < width / 2 ? 60 : 120));
      }
    }
    return PhotoFromU8(photo);
  };
  const auto priors =
      ComputeCapturePriors(std::vector<Photo>{edge(1200, 60), edge(600, 30)}, 2, CancelToken());
  ASSERT_TRUE(priors.ok()) << priors.status();
  const auto mean = [](const PlaneU8& map) {
    double sum = 0;
    for (const uint8_t value : map.data) sum += value;
    return sum / static_cast<double>(map.data.size());
  };
  EXPECT_NEAR(mean(priors->maps[1]) / mean(priors->maps[0]), 1, 0.05);
}

TEST(CapturePriors, AreTheSameBytesForAnyNumberOfThreads) {
  std::vector<Photo> photos;
  for (int i = 0; i < 5; ++i) photos.push_back(MakePhoto(70, 50, 0.5, 0.01, i));
  int done = 0;
  const auto one = ComputeCapturePriors(photos, 1, CancelToken(), {}, [&](int) { ++done; });
  EXPECT_EQ(done, 5);
  const auto four = ComputeCapturePriors(photos, 4, CancelToken());
  ASSERT_TRUE(one.ok() && four.ok());
  EXPECT_EQ(one->scale, four->scale);
  for (int i = 0; i < 5; ++i) EXPECT_EQ(one->maps[i].data, four->maps[i].data);
}

// Far more than the percentile leaves has no structure.
TEST(CapturePriors, OfALampInBlackHaveTheLampsScale) {
  ImageU8 photo(500, 375);
  for (int y = 200; y < 220; ++y) {
    for (int x = 100; x < 120; ++x) std::fill_n(photo.pixel(x, y), 3, uint8_t{250});
  }
  const auto priors =
      ComputeCapturePriors(std::vector<Photo>(2, PhotoFromU8(photo)), 1, CancelToken());
  ASSERT_TRUE(priors.ok()) << priors.status();
  EXPECT_EQ(*std::max_element(priors->maps[0].data.begin(), priors->maps[0].data.end()), 255);
  EXPECT_EQ(priors->maps[0].data[100 * 500 + 300], 0);
}

// What is not black is so little that all of it counts as noise.
TEST(CapturePriors, OfStarsInBlackHaveAFloorOfOneAtMost) {
  ImageU8 photo(640, 480);
  const CounterRng rng(3, 1);
  for (int i = 0; i < 600; ++i) {
    std::fill_n(&photo.data[3 * rng.Below(i, photo.pixels())], 3, uint8_t{200});
  }
  const auto priors =
      ComputeCapturePriors(std::vector<Photo>(2, PhotoFromU8(photo)), 1, CancelToken());
  ASSERT_TRUE(priors.ok()) << priors.status();
  EXPECT_LE(priors->floor, 1);
  EXPECT_GT(priors->scale, 0);
}

TEST(CapturePriors, StopOnRequestAndRefuseACaptureWithoutStructure) {
  CancelToken cancel;
  const std::vector<Photo> black(2, Photo(40, 30));
  const auto none = ComputeCapturePriors(black, 1, cancel);
  EXPECT_EQ(GetErrorDetail(none.status())->reason, "NO_STRUCTURE");
  cancel.Cancel();
  const std::vector<Photo> photos = {MakePhoto(40, 30, 0.5, 0, 1)};
  EXPECT_EQ(ComputeCapturePriors(photos, 1, cancel).status().code(), absl::StatusCode::kCancelled);
}

}  // namespace
}  // namespace litags
