#include "server/jobs/labels.h"

#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"
#include "engine/core/error_test_util.h"

namespace litags {
namespace {

TEST(Labels, ThoseThatShellsAndUrlsTakeAreAllowed) {
  EXPECT_TRUE(CheckLabels(Labels{}).ok());
  EXPECT_TRUE(CheckLabels(Labels{{"site", "north"}, {"run_2-b", "2026.11.26"}, {"done", ""}}).ok());
  EXPECT_TRUE(CheckLabels(Labels{{std::string(63, 'a'), std::string(63, 'Z')}}).ok());
}

TEST(Labels, OthersAreRefusedByName) {
  for (const char* key : {"", "Site", "1st", "-a", "a b", "a.b", "schl\xc3\xbcssel"}) {
    EXPECT_EQ(Reason(CheckLabels(Labels{{key, ""}})), "LABELS_INVALID") << key;
  }
  EXPECT_EQ(Reason(CheckLabels(Labels{{std::string(64, 'a'), ""}})), "LABELS_INVALID");
  const absl::Status value = CheckLabels(Labels{{"site", "north east"}});
  EXPECT_EQ(Reason(value), "LABELS_INVALID");
  EXPECT_EQ(GetErrorDetail(value)->field, "labels.site");
  EXPECT_EQ(Reason(CheckLabels(Labels{{"a", std::string(64, 'x')}})), "LABELS_INVALID");
}

TEST(Labels, ThereAre64AtMost) {
  Labels labels;
  for (int i = 0; i < 64; ++i) labels[absl::StrCat("k", i)] = "";
  EXPECT_TRUE(CheckLabels(labels).ok());
  labels["one-more"] = "";
  EXPECT_EQ(Reason(CheckLabels(labels)), "LABELS_INVALID");
}

}  // namespace
}  // namespace litags
