// What the noise filter is told of a capture's noise.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/core/rng.h"
#include "engine/pipeline/capture.h"
#include "engine/pipeline/capture_test_util.h"

namespace litags {
namespace {

// Codes of noise that the filter expects in pictures of middle grey, of photos of a smooth ramp
// with so much noise.
double NoiseOfPictures(double deviation) {
  const RoomCapture room(4);
  for (int i = 0; i < room.views(); ++i) {
    ImageU8 photo(RoomCapture::kWidth, RoomCapture::kHeight);
    const CounterRng rng(9, i);
    for (size_t k = 0; k < photo.data.size(); ++k) {
      const double ramp = 96 + k / 3 % photo.width, code = ramp + deviation * rng.Normal(k);
      photo.data[k] = static_cast<uint8_t>(std::clamp(std::round(code), 0.0, 255.0));
    }
    room.SetPhoto(i, photo);
  }
  ReconstructOptions options = room.Options(10);
  options.tone = Tone::kNone;
  return 255 * room.Load(options).noise[128];
}

TEST(PictureNoise, IsThatOfRoundingAndAQuarterOfThePhotos) {
  // A target with the photo's own codes is rounded by 1 / sqrt(12) of a code.
  EXPECT_NEAR(NoiseOfPictures(0), 1 / std::sqrt(12.0), 0.01);
  EXPECT_NEAR(NoiseOfPictures(20), 5, 0.5);
}

}  // namespace
}  // namespace litags
