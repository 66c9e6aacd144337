#include "server/jobs/policy.h"

#include <gtest/gtest.h>

#include <limits>

#include "engine/core/error.h"

namespace litags {
namespace {

TEST(JobPolicy, ValuesOutOfRangeAreRefusedByName) {
  const auto field = [](auto change) {
    JobPolicy policy;
    change(policy);
    const auto detail = GetErrorDetail(policy.Validate());
    return detail ? detail->field : "none";
  };
  EXPECT_EQ(field([](JobPolicy&) {}), "none");
  EXPECT_EQ(field([](JobPolicy& p) { p.priority = -101; }), "policy.priority");
  EXPECT_EQ(field([](JobPolicy& p) { p.priority = std::numeric_limits<int>::min(); }),
            "policy.priority");
  EXPECT_EQ(field([](JobPolicy& p) { p.max_run_seconds = -1; }), "policy.max_run_time");
  EXPECT_EQ(field([](JobPolicy& p) { p.max_run_seconds = std::nan(""); }), "policy.max_run_time");
  EXPECT_EQ(field([](JobPolicy& p) { p.max_memory_bytes = 1000; }), "policy.max_memory_bytes");
  EXPECT_EQ(field([](JobPolicy& p) { p.retention_seconds = 1e300; }), "policy.retention");
}

}  // namespace
}  // namespace litags
