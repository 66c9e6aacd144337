#include "client/report/chart.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

namespace litags::report {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

std::vector<CurvePoint> Falling(int points) {
  std::vector<CurvePoint> curve;
  for (int i = 0; i < points; ++i) curve.push_back({10.0 * i, 2.0 * i, 1.0 / (1 + i)});
  return curve;
}

TEST(Chart, TicksAreRoundNumbersWithinTheRange) {
  EXPECT_THAT(Ticks(0, 1500, 5), ElementsAre(0, 500, 1000, 1500));
  EXPECT_THAT(Ticks(17.3, 21.2, 4), ElementsAre(18, 19, 20, 21));
  EXPECT_THAT(Ticks(3, 3, 4), ElementsAre(3));
  EXPECT_EQ(Ticks(0, std::numeric_limits<double>::infinity(), 4).size(), 1u);
}

TEST(Chart, WithoutAPointThereIsNone) { EXPECT_EQ(Chart("Loss", "", {}).markup(), ""); }

TEST(Chart, ItSaysTheLastValueAndTheTimeBelowTheIterations) {
  const std::string svg = Chart("PSNR", "dB", {{0, 5, 12.5}, {1000, 125, 21.25}}).markup();
  EXPECT_THAT(svg, HasSubstr("aria-label=\"PSNR: 21.25 dB at iteration 1k\""));
  EXPECT_THAT(svg, HasSubstr(">1k</text><text"));
  EXPECT_THAT(svg, HasSubstr(">2m05s</text>"));
  EXPECT_THAT(svg, HasSubstr(">53s</text>"));  // between the points, at 400
}

TEST(Chart, OnePointIsInTheMiddleOfAScale) {
  const std::string svg = Chart("PSNR", "dB", {{30, 9, 20}}).markup();
  EXPECT_THAT(svg, HasSubstr(">19.9</text>"));
  EXPECT_THAT(svg, HasSubstr(">20.1</text>"));
  EXPECT_THAT(svg, HasSubstr(">30</text>"));
  EXPECT_THAT(svg, Not(HasSubstr(">30.2</text>")));
}

TEST(Chart, AFewFirstValuesDoNotFlattenTheRest) {
  std::vector<CurvePoint> curve = Falling(200);
  curve.front().value = 1e6;
  EXPECT_THAT(Chart("Loss", "", curve, 0.98).markup(), Not(HasSubstr("000k")));
}

TEST(Chart, NoneOfRisingValuesIsCutOff) {
  std::vector<CurvePoint> curve = Falling(200);
  for (size_t i = 0; i < curve.size(); ++i) curve[i].value = 20 + 0.05 * static_cast<double>(i);
  const std::string svg = Chart("PSNR", "dB", curve).markup();
  const std::string top = ",26.0";  // of the last point alone
  ASSERT_THAT(svg, HasSubstr(top));
  EXPECT_EQ(svg.find(top), svg.rfind(top));
}

TEST(Chart, ALongCurveIsThinned) {
  const auto points = [](const std::vector<CurvePoint>& curve) {
    const std::string svg = Chart("Loss", "", curve).markup();
    const size_t first = svg.find("points=\""), end = svg.find('"', first + 8);
    return std::count(svg.begin() + static_cast<long>(first), svg.begin() + static_cast<long>(end),
                      ',');
  };
  EXPECT_EQ(points(Falling(300)), 300);
  EXPECT_LT(points(Falling(100'000)), 500);
}

}  // namespace
}  // namespace litags::report
