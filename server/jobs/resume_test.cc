#include "server/jobs/resume.h"

#include <gtest/gtest.h>

#include <functional>
#include <string>

#include "engine/core/error.h"
#include "server/jobs/codec.h"

namespace litags {
namespace {

std::string FieldAndReason(const absl::Status& status) {
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << status;
  const auto detail = GetErrorDetail(status);
  return detail ? detail->field + " " + detail->reason : "";
}

TEST(Resume, MoreIterationsKeepTheScheduleOfThoseThatWere) {
  ReconstructOptions before, wanted;
  before.iterations = wanted.iterations = 3000;
  EXPECT_EQ(ResumedOptions(before, wanted)->schedule_iterations, 0);
  wanted.iterations = 5000;
  const auto once = ResumedOptions(before, wanted);
  EXPECT_EQ(once->iterations, 5000);
  EXPECT_EQ(once->schedule_iterations, 3000);
  wanted = *once;
  wanted.iterations = 8000;
  const auto twice = ResumedOptions(*once, wanted);
  EXPECT_EQ(twice->iterations, 8000);
  EXPECT_EQ(twice->schedule_iterations, 3000);
}

TEST(Resume, FewerIterationsAreRefused) {
  ReconstructOptions before, wanted;
  wanted.iterations = before.iterations - 1;
  EXPECT_EQ(FieldAndReason(ResumedOptions(before, wanted).status()),
            "options.iterations ITERATIONS_REDUCED");
}

TEST(Resume, WhatShapesNoIterationMayChange) {
  ReconstructOptions before, wanted;
  wanted.threads = 2;
  wanted.checkpoint_every = 7;
  wanted.preview_every = 9;
  wanted.min_registered = 0.25;  // as SFM_TOO_FEW_REGISTERED advises
  const auto resumed = ResumedOptions(before, wanted);
  ASSERT_TRUE(resumed.ok()) << resumed.status();
  EXPECT_TRUE(Differences(*resumed, wanted).empty());
}

TEST(Resume, AnyOtherOptionIsRefusedByName) {
  using O = ReconstructOptions;
  const std::pair<const char*, std::function<void(O&)>> changes[] = {
      {"tone", [](O& o) { o.tone = Tone::kNone; }},
      {"method", [](O& o) { o.method = Method::k3dgs; }},
      {"seed", [](O& o) { ++o.seed; }},
      {"white_balance", [](O& o) { o.white_balance = WhiteBalance::kCamera; }},
      {"max_gaussians", [](O& o) { o.max_gaussians = 5000; }},
      {"frames", [](O& o) { o.frames = 20; }},
      {"refine_cameras", [](O& o) { o.refine_cameras = true; }},
      {"schedule_iterations", [](O& o) { o.schedule_iterations = 100; }},
  };
  for (const auto& [name, change] : changes) {
    ReconstructOptions before, wanted;
    change(wanted);
    EXPECT_EQ(FieldAndReason(ResumedOptions(before, wanted).status()),
              std::string("options.") + name + " OPTION_NOT_RESUMABLE");
  }
}

}  // namespace
}  // namespace litags
