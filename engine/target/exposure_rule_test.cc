#include "engine/target/exposure_rule.h"

#include <gtest/gtest.h>

#include <cmath>

namespace litags {
namespace {

double GainStops(const LightHistogram& light) { return std::log2(ExposureGain(light)); }

// A room: log-normal light about 2^`middle`, of `spread` stops, nothing above 3 stops over it.
LightHistogram Room(double middle, double spread = 1.6) {
  LightHistogram light;
  for (double x = -5; x <= 3; x += 0.05) {
    light.Add(std::exp2(middle + x), std::exp(-0.5 * x * x / (spread * spread)));
  }
  return light;
}

TEST(LightHistogram, SplitsLightBetweenNeighboursAndKeepsTheWeight) {
  LightHistogram light;
  light.Add(0.18, 2);
  double sum = 0, stops = 0;
  for (int bin = 0; bin < LightHistogram::kBins; ++bin) {
    sum += light.weight(bin);
    stops += light.weight(bin) * LightHistogram::Stops(bin);
  }
  EXPECT_NEAR(sum, 2, 1e-12);
  EXPECT_NEAR(stops / sum, std::log2(0.18), 1e-12);
}

TEST(LightHistogram, TakesAnyLight) {
  LightHistogram light;
  for (const double value : {-1.0, 0.0, 1e-300, 1e300, HUGE_VAL, -HUGE_VAL}) light.Add(value, 1);
  EXPECT_EQ(light.total(), 6);
  EXPECT_TRUE(std::isfinite(ExposureGain(light)));
}

TEST(LightHistogram, SpreadsClippedLightUpwardFromWhite) {
  LightHistogram light;
  light.AddClipped(0.5, 3);
  EXPECT_NEAR(light.total(), 3, 1e-9);
  double below = 0, stops = 0;
  for (int bin = 0; bin < LightHistogram::kBins; ++bin) {
    if (LightHistogram::Stops(bin) < -1.1) below += light.weight(bin);
    stops += light.weight(bin) * LightHistogram::Stops(bin) / 3;
  }
  EXPECT_EQ(below, 0);
  EXPECT_NEAR(stops, -1 + 1, 0.02);  // the mean of an exponential distribution is its scale
}

TEST(ExposureRule, BandSharesAreThoseOfTheBrightenedLight) {
  LightHistogram light, bright;
  for (const double stops : {-9.0, -4.5, -4.5, -0.5}) {
    light.Add(std::exp2(stops - 3), 1);
    bright.Add(std::exp2(stops), 1);
  }
  const int step = 3 * LightHistogram::kBinsPerStop;
  const BandShares row = LogBandShares(light, step, step).front();
  const BandShares same = LogBandShares(bright, 0, 0).front();
  for (int band = 0; band < ExposureRule::kBands; ++band) EXPECT_NEAR(row[band], same[band], 1e-9);
  EXPECT_NEAR(std::exp(row[0]), 0.25 + 0.01, 0.005);   // -9
  EXPECT_NEAR(std::exp(row[3]), 0.38 + 0.01, 0.06);    // two at -4.5, less what borders take
  EXPECT_NEAR(std::exp(row[11]), 0.00 + 0.01, 0.005);  // above +3
}

TEST(ExposureRule, PutsARoomNearTheMiddle) {
  const double stops = -8 + GainStops(Room(-8));
  EXPECT_GT(stops, -4);  // code 0.30 of the median
  EXPECT_LT(stops, -2);  // code 0.54
}

TEST(ExposureRule, TwiceTheLightTakesHalfTheGain) {
  const double gain = GainStops(Room(-8));
  EXPECT_NEAR(GainStops(Room(-7)), gain - 1, 1e-6);
  EXPECT_NEAR(GainStops(Room(-3)), gain - 5, 1e-6);
  EXPECT_NEAR(GainStops(Room(-7.83)), gain - 0.17, 0.01);  // bins are 1/8 stop
}

TEST(ExposureRule, WeightsAreRelative) {
  LightHistogram light, tenfold;
  for (const double value : {0.001, 0.002, 0.01}) {
    light.Add(value, 1);
    tenfold.Add(value, 10);
  }
  EXPECT_NEAR(GainStops(light), GainStops(tenfold), 1e-9);
}

TEST(ExposureRule, LampsMoveItLittleNoMatterHowBright) {
  const double without = GainStops(Room(-8));
  double last = 0;
  for (const double over : {6.0, 8.0, 10.0}) {  // stops above the middle
    LightHistogram light = Room(-8);
    light.Add(std::exp2(-8 + over), 0.05 * light.total());
    last = GainStops(light);
    EXPECT_NEAR(last, without, 0.75) << over;
  }
  LightHistogram brighter = Room(-8);
  brighter.Add(std::exp2(-8 + 13.0), 0.05 * brighter.total());
  EXPECT_NEAR(GainStops(brighter), last, 0.15);
}

TEST(ExposureRule, IsContinuousInEveryShare) {
  const double without = GainStops(Room(-8));
  for (const double stops : {-24.0, -12.0, -8.0, -5.0, -1.0, 4.0}) {
    LightHistogram light = Room(-8);
    light.Add(std::exp2(stops), 1e-4 * light.total());
    EXPECT_NEAR(GainStops(light), without, 0.02) << stops;
  }
}

TEST(ExposureRule, IsContinuousInTheClippedShare) {
  double last = GainStops(Room(-3));
  const double without = last;
  for (double share = 1e-4; share < 0.9; share *= 1.03) {
    LightHistogram light = Room(-3);
    light.AddClipped(1, share / (1 - share) * light.total());
    const double stops = GainStops(light);
    EXPECT_NEAR(stops, last, 0.1) << share;
    last = stops;
  }
  EXPECT_LT(last, without - 1);  // mostly clipped: much darker
}

TEST(ExposureRule, IsDefinedForWhateverLight) {
  const LightHistogram empty;
  EXPECT_EQ(ExposureGain(empty), 1);

  LightHistogram black, white, one, torch;
  black.Add(0, 1);
  white.AddClipped(1, 1);
  one.Add(0.01, 1);
  torch.Add(0, 0.999);
  torch.Add(0.5, 0.001);
  for (const LightHistogram& light : {black, white, one, torch}) {
    EXPECT_GT(ExposureGain(light), 0);
    EXPECT_TRUE(std::isfinite(ExposureGain(light)));
  }
  EXPECT_LT(ExposureGain(white), 1);
  // One colour is neither black nor clipped.
  EXPECT_GT(0.01 * ExposureGain(one), std::exp2(-6));
  EXPECT_LT(0.01 * ExposureGain(one), 1.2);
}

}  // namespace
}  // namespace litags
