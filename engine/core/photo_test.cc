#include "engine/core/photo.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "engine/core/code_curve.h"

namespace litags {
namespace {

TEST(Photo, SamplesOfLightAreThoseThatTheLightIsOf) {
  const LinearTable& light = LinearTable::Get();
  const SampleTable& sample = SampleTable::Get();
  for (int s = -32768; s <= 32767; ++s) {
    ASSERT_NEAR(sample(light(static_cast<int16_t>(s))), s, 1) << s;
  }
}

TEST(Photo, LightBetweenSamplesBecomesTheNearest) {
  for (double encoded = -1.99; encoded < 1.99; encoded += 0.00037) {
    const int16_t sample = SampleTable::Get()(static_cast<float>(LinearFromSrgb(encoded)));
    ASSERT_NEAR(sample, encoded * kPhotoWhite, 0.5 + 0.125) << encoded;
  }
}

TEST(Photo, BelowBlackLightIsALine) {
  const LinearTable& light = LinearTable::Get();
  EXPECT_EQ(light(0), 0);
  EXPECT_EQ(light(kPhotoWhite), 1);
  for (const int16_t s : {1, 64, 600}) EXPECT_EQ(light(-s), -light(s)) << s;
}

TEST(Photo, All8BitCodesComeBack) {
  ImageU8 codes(256, 1);
  for (size_t i = 0; i < codes.data.size(); ++i) codes.data[i] = static_cast<uint8_t>(i / 3);
  const Photo photo = PhotoFromU8(codes);
  EXPECT_EQ(photo.width, 256);
  EXPECT_EQ(photo.height, 1);
  EXPECT_EQ(PhotoToU8(photo).data, codes.data);
  EXPECT_EQ(photo.pixel(255, 0)[0], kPhotoWhite);
  // A quarter of a code to either side does not matter; beyond black and white there is no code.
  Photo off = photo;
  for (size_t i = 0; i < off.data.size(); ++i) off.data[i] += i % 2 == 0 ? 16 : -16;
  EXPECT_EQ(PhotoToU8(off).data, codes.data);
  off.data = {-32768, -600, 32767};
  off.width = off.height = 1;
  EXPECT_EQ(PhotoToU8(off).data, (std::vector<uint8_t>{0, 0, 255}));
}

TEST(Photo, ASampleIsTheNearestAndInRange) {
  EXPECT_EQ(PhotoSample(0.5f), kPhotoWhite / 2);
  EXPECT_EQ(PhotoSample(-0.25f), -kPhotoWhite / 4);
  EXPECT_EQ(PhotoSample(10.7f / kPhotoWhite), 11);
  EXPECT_EQ(PhotoSample(-10.7f / kPhotoWhite), -11);
  EXPECT_EQ(PhotoSample(2.0f), 32767);
  EXPECT_EQ(PhotoSample(-1e30f), -32768);
  EXPECT_EQ(PhotoSample(std::numeric_limits<float>::infinity()), 32767);
  EXPECT_EQ(PhotoSample(std::numeric_limits<float>::quiet_NaN()), 0);
  EXPECT_EQ(SampleTable::Get()(std::numeric_limits<float>::quiet_NaN()), 0);
  EXPECT_EQ(SampleTable::Get()(std::numeric_limits<float>::infinity()), 32767);
}

TEST(Photo, PlanesHaveTheEncodedValuesChannelByChannel) {
  Photo photo(2, 1);
  photo.data = {0, kPhotoWhite, -kPhotoWhite / 2, 1, 2, 3};
  const Planes planes = ToPlanes(photo);
  ASSERT_EQ(planes.channels, 3);
  EXPECT_EQ(planes.at(1, 0, 0), 1);
  EXPECT_EQ(planes.at(2, 0, 0), -0.5f);
  EXPECT_EQ(planes.at(2, 0, 1), 3.0f / kPhotoWhite);
}

TEST(CodeCurve, IsLinearBetweenCodesAndKeepsWhatLiesBeyond) {
  CodeCurve curve;
  for (int i = 0; i < 256; ++i) curve[i] = 0.1f + 0.5f * i / 255;
  EXPECT_FLOAT_EQ(ApplyCurve(curve, 0.3f), 0.25f);
  EXPECT_FLOAT_EQ(ApplyCurve(curve, -0.2f), -0.1f);
  EXPECT_FLOAT_EQ(ApplyCurve(curve, 1.2f), 0.8f);
  EXPECT_TRUE(std::isnan(ApplyCurve(curve, std::numeric_limits<float>::quiet_NaN())));
}

}  // namespace
}  // namespace litags
