#include "server/errors/to_grpc.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <optional>
#include <string>

#include "engine/core/error.h"
#include "google/rpc/error_details.pb.h"
#include "litags/v1/errors.pb.h"

namespace litags {
namespace {

TEST(ToGrpc, AnswersFitTheTrailersThatClientsTakeAndAreValidText) {
  std::string text;
  for (int i = 0; i < 100'000; ++i) text += "ü\xFF写";
  const grpc::Status status = ToGrpc(InvalidInput("BAD_FILE_NAME", text, text));
  v1::RpcStatus rpc;
  ASSERT_TRUE(rpc.ParseFromString(status.error_details()));
  v1::ErrorDetail detail;
  ASSERT_TRUE(rpc.details(0).UnpackTo(&detail));
  EXPECT_EQ(rpc.message(), status.error_message());
  EXPECT_THAT(detail.field(), ::testing::StartsWith("ü\uFFFD写ü"));
  EXPECT_TRUE(detail.field().ends_with("ü") || detail.field().ends_with("写") ||
              detail.field().ends_with("\uFFFD"));
  // Percent-encoded, and in Base64.
  EXPECT_LT(3 * status.error_message().size() + 4 * status.error_details().size() / 3, 7000u);
}

// The details of an error that are of google.rpc, by type.
template <class Detail>
std::optional<Detail> GoogleDetail(const absl::Status& status) {
  v1::RpcStatus rpc;
  EXPECT_TRUE(rpc.ParseFromString(ToGrpc(status).error_details()));
  Detail detail;
  for (const auto& any : rpc.details()) {
    if (any.UnpackTo(&detail)) return detail;
  }
  return std::nullopt;
}

TEST(ToGrpc, ErrorsHaveTheDetailsThatEveryLanguageReads) {
  using google::rpc::BadRequest, google::rpc::ErrorInfo, google::rpc::QuotaFailure,
      google::rpc::RetryInfo;
  const absl::Status bad = InvalidInput("BAD_OPTION", "options.iterations", "too many");
  const auto info = GoogleDetail<ErrorInfo>(bad);
  ASSERT_TRUE(info.has_value());
  EXPECT_EQ(info->reason(), "BAD_OPTION");
  EXPECT_EQ(info->domain(), "litags");
  EXPECT_EQ(info->metadata().at("field"), "options.iterations");
  const auto request = GoogleDetail<BadRequest>(bad);
  ASSERT_TRUE(request.has_value());
  EXPECT_EQ(request->field_violations(0).field(), "options.iterations");
  EXPECT_EQ(request->field_violations(0).description(), "too many");
  EXPECT_FALSE(GoogleDetail<RetryInfo>(bad).has_value());
  EXPECT_FALSE(GoogleDetail<QuotaFailure>(bad).has_value());

  const auto full = [](const char* reason) {
    return MakeError(absl::StatusCode::kResourceExhausted, reason, "", "no more");
  };
  EXPECT_EQ(GoogleDetail<RetryInfo>(full("SERVER_BUSY"))->retry_delay().seconds(), 1);
  EXPECT_TRUE(GoogleDetail<RetryInfo>(absl::UnavailableError("shuts down")).has_value());
  EXPECT_EQ(GoogleDetail<QuotaFailure>(full("JOB_QUOTA_REACHED"))->violations(0).subject(),
            "client");
  EXPECT_FALSE(GoogleDetail<RetryInfo>(full("JOB_QUOTA_REACHED")).has_value());
  EXPECT_FALSE(GoogleDetail<BadRequest>(full("JOB_QUOTA_REACHED")).has_value());
  EXPECT_FALSE(GoogleDetail<RetryInfo>(full("JOB_CAP_EXCEEDED")).has_value());
  EXPECT_EQ(GoogleDetail<ErrorInfo>(absl::InternalError("?"))->reason(), "INTERNAL");
}

}  // namespace
}  // namespace litags
