#include "engine/train/work_forecast.h"

#include <gtest/gtest.h>

#include <limits>
#include <vector>

#include "engine/core/splats.h"
#include "engine/train/train_test_util.h"

namespace litags {
namespace {

std::vector<TrainView> OneView() {
  std::vector<TrainView> views(1);
  views[0].view.camera = RingCamera(0, 4, 256, 128);
  views[0].photo = views[0].target = Photo(256, 128);
  return views;
}

TrainOptions Options() {
  TrainOptions options;
  options.iterations = 100;
  options.max_gaussians = 1'000'000;
  options.recipe.coarse_levels = 1;  // 128x64 px for 50 iterations
  options.recipe.coarse_gaussians = 1.5;
  options.recipe.densify_start = 10;
  options.recipe.densify_every = 10;
  return options;
}

WorkForecast ForecastOf(const TrainOptions& options, int from, int to, double gaussians) {
  const std::vector<TrainView> views = OneView();
  const ViewPyramid pyramid(&views, options);
  const DensitySchedule density(options, {{0, 0, 0}}, 1, pyramid.CoarseEnd());
  return ForecastWork(pyramid, density, from, to, gaussians);
}

double Forecast(const TrainOptions& options, int from, int to, double gaussians) {
  return ForecastOf(options, from, to, gaussians).work;
}

double Work(double pixels, double gaussians) {
  return pixels + kPixelsBeside +
         kPixelsOfGaussian * gaussians * SplatRowsForDegree(1) / double{kSplatRows};
}

TEST(ForecastWork, GrowsAtDensitySteps) {
  const TrainOptions options = Options();
  EXPECT_DOUBLE_EQ(Forecast(options, 0, 10, 1000), 10 * Work(128 * 64, 1000));
  EXPECT_DOUBLE_EQ(Forecast(options, 0, 20, 1000),
                   10 * Work(128 * 64, 1000) + 10 * Work(128 * 64, kGrowthOfStep * 1000));
}

TEST(ForecastWork, GrowsToWhatPhotosOfALevelAllow) {
  // 1.5 for each of 128x64 pixels.
  EXPECT_DOUBLE_EQ(Forecast(Options(), 0, 20, 12'000),
                   10 * Work(128 * 64, 12'000) + 10 * Work(128 * 64, 12'288));
}

TEST(ForecastWork, GrowthEnds) {
  // At half of the run, as the coarse part does; the step there is the last.
  const double at_end = 1000 * kGrowthOfStep;
  EXPECT_NEAR(Forecast(Options(), 49, 100, 1000),
              Work(128 * 64, 1000) + 50 * Work(256 * 128, at_end), 1e-6);
}

TEST(DensitySchedule, GrowthEndsWithTheRunHoweverLateItMay) {
  TrainOptions options = Options();
  options.recipe.densify_until = 1'000'000;
  const int end = DensitySchedule(options, {{0, 0, 0}}, 1, 50).GrowthEnd();
  EXPECT_EQ(end, 50);
  options.recipe.densify_until = std::numeric_limits<int>::max();
  EXPECT_EQ(DensitySchedule(options, {{0, 0, 0}}, 1, 50).GrowthEnd(), end);
}

TEST(ForecastWork, LosesNoGaussiansAboveTheLimit) {
  EXPECT_DOUBLE_EQ(Forecast(Options(), 0, 20, 20'000), 20 * Work(128 * 64, 20'000));
}

TEST(ForecastWork, SumsTheGaussiansOfTheIterations) {
  EXPECT_DOUBLE_EQ(ForecastOf(Options(), 0, 20, 1000).gaussians,
                   10 * 1000 + 10 * kGrowthOfStep * 1000);
}

TEST(ForecastWork, IsNothingAtTheEnd) { EXPECT_EQ(Forecast(Options(), 100, 100, 1000), 0); }

}  // namespace
}  // namespace litags
