#include "server/api/job_filter.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "engine/core/error_test_util.h"
#include "server/jobs/codec.h"

namespace litags {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

JobRecord Job(const std::string& id, JobState state, const std::string& name, Labels labels) {
  JobRecord job;
  job.id = id;
  job.state = state;
  job.display_name = name;
  job.labels = Encode(labels);
  return job;
}

std::vector<JobRecord> Jobs() {
  std::vector<JobRecord> jobs = {
      Job("a1", JobState::kFailed, "yard at night", {{"site", "north"}}),
      Job("b2", JobState::kSucceeded, "yard by day", {{"site", "south"}, {"checked", ""}}),
      Job("c3", JobState::kQueued, "hall", {})};
  // 2026-11-01T00:00:00Z, and a day and two days later.
  for (int i = 0; i < 3; ++i) jobs[i].create_time_ms = 1793491200000 + i * int64_t{86'400'000};
  jobs[0].end_time_ms = jobs[0].create_time_ms + 1000;
  jobs[1].priority = 5;
  jobs[1].owner = "robot";
  return jobs;
}

// Ids of the jobs that the filter lets through.
std::vector<std::string> Through(std::string_view text) {
  const auto filter = ParseJobFilter(text);
  if (!filter.ok()) return {std::string(filter.status().message())};
  std::vector<std::string> ids;
  for (const JobRecord& job : Jobs()) {
    if ((*filter)(job)) ids.push_back(job.id);
  }
  return ids;
}

TEST(JobFilter, NothingLetsAllThrough) {
  EXPECT_THAT(Through(""), ElementsAre("a1", "b2", "c3"));
  EXPECT_THAT(Through("  "), ElementsAre("a1", "b2", "c3"));
}

TEST(JobFilter, EachFieldIsCompared) {
  EXPECT_THAT(Through("state = FAILED"), ElementsAre("a1"));
  EXPECT_THAT(Through("state=JOB_STATE_QUEUED"), ElementsAre("c3"));
  EXPECT_THAT(Through("state != FAILED"), ElementsAre("b2", "c3"));
  EXPECT_THAT(Through("name = jobs/b2"), ElementsAre("b2"));
  EXPECT_THAT(Through("owner = robot"), ElementsAre("b2"));
  EXPECT_THAT(Through("policy.priority >= 5"), ElementsAre("b2"));
  EXPECT_THAT(Through("policy.priority < 5"), ElementsAre("a1", "c3"));
  EXPECT_THAT(Through("display_name = hall"), ElementsAre("c3"));
  EXPECT_THAT(Through("display_name = \"yard*\""), ElementsAre("a1", "b2"));
  EXPECT_THAT(Through("display_name = \"*day\""), ElementsAre("b2"));
  EXPECT_THAT(Through("display_name:night"), ElementsAre("a1"));
  EXPECT_THAT(Through("labels.site = north"), ElementsAre("a1"));
  EXPECT_THAT(Through("labels.site != north"), ElementsAre("b2", "c3"));
  EXPECT_THAT(Through("labels:checked"), ElementsAre("b2"));
  EXPECT_THAT(Through("labels.site:*"), ElementsAre("a1", "b2"));
}

TEST(JobFilter, TimesAreMoments) {
  EXPECT_THAT(Through("create_time > \"2026-11-01T00:00:00Z\""), ElementsAre("b2", "c3"));
  EXPECT_THAT(Through("create_time <= \"2026-11-02T01:00:00+01:00\""), ElementsAre("a1", "b2"));
  // Two have not ended yet.
  EXPECT_THAT(Through("end_time < \"2030-01-01T00:00:00Z\""), ElementsAre("a1"));
  EXPECT_THAT(Through("end_time != \"2030-01-01T00:00:00Z\""), ElementsAre("a1", "b2", "c3"));
}

TEST(JobFilter, WordsJoinComparisons) {
  EXPECT_THAT(Through("state = FAILED AND labels.site = south"), ElementsAre());
  EXPECT_THAT(Through("state = FAILED OR labels.site = south"), ElementsAre("a1", "b2"));
  EXPECT_THAT(Through("NOT state = FAILED"), ElementsAre("b2", "c3"));
  EXPECT_THAT(Through("-state = FAILED"), ElementsAre("b2", "c3"));
  EXPECT_THAT(Through("NOT (state = FAILED OR state = QUEUED)"), ElementsAre("b2"));
  // OR binds more tightly than AND, as AIP-160 has it.
  EXPECT_THAT(Through("state = QUEUED AND display_name = hall OR display_name:yard"),
              ElementsAre("c3"));
}

TEST(JobFilter, WhatIsWrongIsNamedWithItsPlace) {
  const auto refused = [](const std::string& text) {
    const auto filter = ParseJobFilter(text);
    EXPECT_EQ(Reason(filter.status()), "FILTER_INVALID") << text;
    EXPECT_EQ(GetErrorDetail(filter.status())->field, "filter");
    return std::string(filter.status().message());
  };
  EXPECT_THAT(refused("colour = red"), HasSubstr("character 1 "));
  EXPECT_THAT(refused("state = FAILED AND"), HasSubstr("character 19 "));
  EXPECT_THAT(refused("state = LOST"), HasSubstr("a state"));
  EXPECT_THAT(refused("state < FAILED"), HasSubstr("= or !="));
  EXPECT_THAT(refused("create_time > yesterday"), HasSubstr("a time"));
  EXPECT_THAT(refused("(state = FAILED"), HasSubstr("a )"));
  EXPECT_THAT(refused("state = FAILED name = x"), HasSubstr("AND, OR or the end"));
  EXPECT_THAT(refused("display_name = \"x"), HasSubstr("ends the text"));
  refused("policy.priority > many");
  refused("display_name > x");
  refused("=");
  refused("state");
  refused(std::string(1001, ' '));
  refused(absl::StrCat(std::string(200, '('), "state = FAILED", std::string(200, ')')));
  refused(std::string(900, '-'));
}

TEST(JobFilter, AQuoteMayHoldAnything) {
  std::vector<JobRecord> jobs = Jobs();
  jobs[0].display_name = "say \"AND\" (twice)";
  const auto filter = ParseJobFilter("display_name = \"say \\\"AND\\\" (twice)\"");
  ASSERT_TRUE(filter.ok()) << filter.status();
  EXPECT_TRUE((*filter)(jobs[0]));
  EXPECT_FALSE((*filter)(jobs[1]));
}

}  // namespace
}  // namespace litags
