#include "client/exit_code.h"

#include <gtest/gtest.h>

#include "client/status.h"

namespace litags::client {
namespace {

using Code = absl::StatusCode;

int Of(Code code, std::string_view reason, std::string_view field) {
  return ExitCodeOf(LocalError(code, reason, field, "no"));
}

TEST(ExitCode, WhatIsWrongWithTheInputIsTwoWhateverTheCode) {
  EXPECT_EQ(Of(Code::kInvalidArgument, "BAD_OPTION", "options.iterations"), kExitBadInput);
  EXPECT_EQ(Of(Code::kFailedPrecondition, "VIDEO_NOT_ALONE", "videos"), kExitBadInput);
  EXPECT_EQ(Of(Code::kFailedPrecondition, "DEPTH_MAPS_MISSING", "options.depth_source"),
            kExitBadInput);
  EXPECT_EQ(Of(Code::kFailedPrecondition, "EXPORT_EMPTY", "crop"), kExitBadInput);
  EXPECT_EQ(Of(Code::kResourceExhausted, "JOB_CAP_EXCEEDED", "options.iterations"), kExitBadInput);
  EXPECT_EQ(Of(Code::kAlreadyExists, "REQUEST_ID_REUSED", "request_id"), kExitBadInput);
}

TEST(ExitCode, AJobsStateAndAServerThatIsFullAreNotTheInput) {
  EXPECT_EQ(Of(Code::kFailedPrecondition, "JOB_RUNNING", "name"), kExitServerError);
  EXPECT_EQ(Of(Code::kFailedPrecondition, "BLOBS_DENIED", ""), kExitServerError);
  EXPECT_EQ(Of(Code::kResourceExhausted, "SERVER_BUSY", ""), kExitServerError);
  EXPECT_EQ(Of(Code::kResourceExhausted, "DISK_FULL", "archives[a.zip]"), kExitServerError);
  EXPECT_EQ(Of(Code::kResourceExhausted, "OUTPUT_DISK_FULL", "-o"), kExitServerError);
  EXPECT_EQ(Of(Code::kInternal, "SCENE_MISSING", "name"), kExitServerError);
}

}  // namespace
}  // namespace litags::client
