#include "server/jobs/state_machine.h"

#include <gtest/gtest.h>

#include <map>

#include "engine/core/error.h"

namespace litags {
namespace {

constexpr JobAction kAllJobActions[] = {
    JobAction::kUpload,  JobAction::kStart,  JobAction::kCancel, JobAction::kResume,
    JobAction::kExtend,  JobAction::kRemove, JobAction::kLease,  JobAction::kReport,
    JobAction::kSucceed, JobAction::kFail,   JobAction::kStop,   JobAction::kRequeue};

// The whole table, written a second time and in another shape: rows are states, columns actions in
// the order of kAllJobActions; the letter is that of the state that follows, '.' means refused.
// clang-format off
const std::map<JobState, std::string> kExpected = {
    //                      Upload, Start, Cancel, Resume, eXtend, remoVe, Lease, rePort, sucCeed,
    //                      Fail, stOp, requEue
    //                      USCRXVLPCFOE
    {JobState::kUploading, "UQC..U......"},
    {JobState::kQueued,    "..C..QR....."},
    {JobState::kRunning,   "..R....RSFCQ"},
    {JobState::kSucceeded, "....QS......"},
    {JobState::kFailed,    "U..QQF......"},
    {JobState::kCancelled, "..CQQC......"},
};
// clang-format on

TEST(StateMachine, EveryActionInEveryStateDoesWhatTheTableSays) {
  for (const JobState state : kAllJobStates) {
    for (size_t a = 0; a < std::size(kAllJobActions); ++a) {
      SCOPED_TRACE(std::string(JobStateName(state)) + " action " + std::to_string(a));
      const auto next = NextState(state, kAllJobActions[a]);
      const char expected = kExpected.at(state)[a];
      if (expected == '.') {
        EXPECT_EQ(next.status().code(), absl::StatusCode::kFailedPrecondition);
      } else {
        ASSERT_TRUE(next.ok()) << next.status();
        EXPECT_EQ(JobStateName(*next)[0], expected);
      }
    }
  }
}

TEST(StateMachine, RefusalsNameTheStateAndHaveAReasonPerAction) {
  const std::map<JobAction, std::pair<JobState, std::string>> reasons = {
      {JobAction::kUpload, {JobState::kRunning, "JOB_NOT_UPLOADING"}},
      {JobAction::kStart, {JobState::kQueued, "JOB_NOT_UPLOADING"}},
      {JobAction::kCancel, {JobState::kSucceeded, "JOB_ALREADY_DONE"}},
      {JobAction::kResume, {JobState::kRunning, "JOB_NOT_RESUMABLE"}},
      {JobAction::kExtend, {JobState::kUploading, "JOB_NOT_RESUMABLE"}},
      {JobAction::kRemove, {JobState::kRunning, "JOB_RUNNING"}},
      {JobAction::kLease, {JobState::kRunning, "JOB_NOT_QUEUED"}},
      {JobAction::kReport, {JobState::kQueued, "JOB_NOT_RUNNING"}},
  };
  for (const auto& [action, expected] : reasons) {
    const absl::Status status = NextState(expected.first, action).status();
    const auto detail = GetErrorDetail(status);
    ASSERT_TRUE(detail.has_value());
    EXPECT_EQ(detail->reason, expected.second);
    EXPECT_EQ(detail->field, "name");
    EXPECT_NE(std::string(status.message()).find(std::string(JobStateName(expected.first))),
              std::string::npos);
  }
}

}  // namespace
}  // namespace litags
