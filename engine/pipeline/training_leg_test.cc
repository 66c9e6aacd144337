#include "engine/pipeline/training_leg.h"

#include <gtest/gtest.h>

namespace litags {
namespace {

TEST(TrainingLeg, CountsStepsByWorkCheckpointsByGaussiansAndTheRestByIterations) {
  TrainingLeg leg;
  leg.start = 1000;
  leg.first = 200;
  leg.work = 300;
  leg.step_seconds = 60;  // 0.2 s for each unit of work
  leg.checkpoint_seconds = 8;
  leg.checkpoint_gaussians = 4000;  // 0.002 s for each Gaussian
  // 100 iterations took 78 s, 10 s of them beside steps and checkpoints: 0.1 s each.
  const double now = 1078;
  const WorkForecast forecast = {.work = 5000, .gaussians = 2e6};  // of 400 iterations
  EXPECT_DOUBLE_EQ(leg.SecondsOfWork(5000), 1000);
  EXPECT_DOUBLE_EQ(leg.SecondsLeft(now, 300, 700, forecast, 100), 1000 + 40 + 2e6 * 0.002 / 100);
}

TEST(TrainingLeg, KnowsNothingOfCheckpointsBeforeTheFirst) {
  TrainingLeg leg;
  leg.work = 10;
  leg.step_seconds = 5;
  EXPECT_DOUBLE_EQ(leg.SecondsLeft(5, 10, 20, {.work = 10, .gaussians = 1e6}, 1), 5);
}

}  // namespace
}  // namespace litags
