#include "engine/sample/sensor.h"

#include <utility>

#include "engine/core/color.h"
#include "gtest/gtest.h"

namespace litags::sample {
namespace {

Planes Flat(float level, int side = 64) {
  Planes light(3, side, side);
  for (float& v : light.data) v = level;
  return light;
}

// Mean and variance of a picture's values in linear light.
std::pair<double, double> LinearMoments(const ImageU8& image) {
  double sum = 0, square = 0;
  for (const uint8_t code : image.data) {
    const double v = LinearFromSrgb(code / 255.0);
    sum += v;
    square += v * v;
  }
  const double mean = sum / image.data.size();
  return {mean, square / image.data.size() - mean * mean};
}

TEST(Srgb, EncodingAndDecodingAreInverse) {
  for (double v = 0; v <= 1; v += 0.01) EXPECT_NEAR(LinearFromSrgb(SrgbFromLinear(v)), v, 1e-12);
}

TEST(Expose, NoiseHasTheVarianceOfPhotonsAndReadNoise) {
  const double level = 0.01;  // 150 electrons: the normal law stands for Poisson's
  const auto [mean, variance] =
      LinearMoments(Expose(Flat(1), {level, level, level}, {}, CounterRng(1, 2)));
  const double noise = (level * 15000 + 4 * 4) / (15000.0 * 15000.0);
  // Rounding to ADC and output codes adds a variance of step^2 / 12 each.
  const double adc_step = 1 / 4031.0;
  const double code_step =
      LinearFromSrgb(SrgbFromLinear(level) + 1 / 255.0) - LinearFromSrgb(SrgbFromLinear(level));
  const double expected = noise + (adc_step * adc_step + code_step * code_step) / 12;
  // 12288 values: standard errors are 0.08 % of the mean and 1.3 % of the variance.
  EXPECT_NEAR(mean / level, 1, 0.01);
  EXPECT_NEAR(variance / expected, 1, 0.06);
}

TEST(Expose, FewPhotonsFollowPoissonsLaw) {
  SensorOptions counter;  // one electron is one distinct code
  counter.full_well = 50;
  counter.read_noise = 0;
  counter.adc_bits = 16;
  counter.adc_black = 0;
  const auto [mean, variance] =
      LinearMoments(Expose(Flat(0.04f), {1, 1, 1}, counter, CounterRng(3, 4)));
  EXPECT_NEAR(mean * 50, 2, 0.05);
  EXPECT_NEAR(variance * 50 * 50, 2, 0.1);
}

TEST(Expose, TooMuchLightClipsAtWhite) {
  const ImageU8 image = Expose(Flat(0.5f, 16), {10, 10, 10}, {}, CounterRng(1, 1));
  for (const uint8_t code : image.data) EXPECT_EQ(code, 255);
}

TEST(Expose, NoiseComesFromTheGeneratorAlone) {
  const auto expose = [](uint64_t stream) {
    return Expose(Flat(0.02f, 16), {1, 1, 1}, {}, CounterRng(9, stream)).data;
  };
  EXPECT_EQ(expose(1), expose(1));
  EXPECT_NE(expose(1), expose(2));
}

TEST(Develop, IsTheExposureWithoutNoise) {
  const Planes codes = Develop(Flat(0.2f, 4), {0.5, 1, 10});
  EXPECT_NEAR(codes.at(0, 0, 0), SrgbFromLinear(0.1), 1e-6);
  EXPECT_NEAR(codes.at(1, 0, 0), SrgbFromLinear(0.2), 1e-6);
  EXPECT_EQ(codes.at(2, 0, 0), 1.0f);
}

}  // namespace
}  // namespace litags::sample
