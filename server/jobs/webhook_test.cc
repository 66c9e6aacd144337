#include "server/jobs/webhook.h"

#include <gtest/gtest.h>

#include <string>

#include "engine/core/error_test_util.h"

namespace litags {
namespace {

const std::string kSecret(32, 's');

std::string ReasonOf(const std::string& url, const WebhookPolicy& policy,
                     const std::string& secret = kSecret) {
  const absl::Status status = CheckWebhook({url, secret}, policy);
  return status.ok() ? "" : Reason(status);
}

TEST(Webhook, GoesWhereTheOperatorLetsIt) {
  const WebhookPolicy some{{"hooks.example.com", "*.example.org"}};
  EXPECT_EQ(ReasonOf("https://hooks.example.com/litags", some), "");
  EXPECT_EQ(ReasonOf("https://HOOKS.example.com:8443", some), "");
  EXPECT_EQ(ReasonOf("https://a.b.example.org/?x=1", some), "");
  for (const char* url :
       {"https://example.com/", "https://evil-hooks.example.com/", "https://example.org/",
        "https://hooks.example.com.evil.net/", "https://evil.net/https://hooks.example.com/",
        "https://evil.net?hooks.example.com", "https://evil.net#.example.org"}) {
    EXPECT_EQ(ReasonOf(url, some), "WEBHOOK_NOT_ALLOWED") << url;
  }
  EXPECT_EQ(ReasonOf("https://hooks.example.com/", {}), "WEBHOOK_NOT_ALLOWED");
  EXPECT_EQ(ReasonOf("https://any.thing/", {{"*"}}), "");
  EXPECT_EQ(ReasonOf("", {}, ""), "");
}

TEST(Webhook, HostsOfTheOperatorMayBeCapitalsAndMustBeHosts) {
  const WebhookPolicy some{{"Hooks.Example.com", "*.Example.ORG"}};
  EXPECT_EQ(ReasonOf("https://hooks.example.com/", some), "");
  EXPECT_EQ(ReasonOf("https://a.example.org/", some), "");
  EXPECT_TRUE(CheckWebhookHosts({"*", "*.example.com", "Hooks.example.com", "10.0.0.1"}).ok());
  for (const char* host : {"", "*.", "*example.com", ".example.com", "https://example.com",
                           "example.com:443", "example.com/hook", " example.com", "a b", "*.*"}) {
    EXPECT_EQ(Reason(CheckWebhookHosts({"*", host})), "SETTING_INVALID") << host;
  }
}

TEST(Webhook, WhatIsNoPlainUrlIsRefused) {
  const WebhookPolicy all{{"*"}};
  for (const char* url :
       {"http://example.com/", "ftp://example.com/", "example.com", "https://", "https:///x",
        "https://user:secret@example.com/", "https://example.com:port/", "https://example.com:/",
        "https://[::1]/", "https://ex ample.com/", "https://example.com/\n",
        "https://exa%6Dple.com/", "https://example.com\\@evil.net/", "file:///etc/passwd"}) {
    EXPECT_EQ(ReasonOf(url, all), "WEBHOOK_INVALID") << url;
  }
  EXPECT_EQ(ReasonOf("https://example.com/" + std::string(500, 'x'), all), "WEBHOOK_INVALID");
  EXPECT_EQ(ReasonOf("http://example.com/", {{"*"}, true}), "");
  EXPECT_EQ(ReasonOf("", all), "WEBHOOK_INVALID");
  EXPECT_EQ(ReasonOf("https://example.com/", all, "short"), "WEBHOOK_INVALID");
  EXPECT_EQ(ReasonOf("https://example.com/", all, std::string(129, 's')), "WEBHOOK_INVALID");
}

// printf '1700000000.{"a":1}' | openssl dgst -sha256 -hmac 0123456789abcdef
TEST(Webhook, TheSignatureIsThatOfOtherPrograms) {
  EXPECT_EQ(WebhookSignature("0123456789abcdef", 1700000000, "{\"a\":1}"),
            "sha256=9eb18f493f8ec135d9eb2dad817c369bb4e9cbfa818657897a7437c1cd8c3a23");
}

TEST(Webhook, PausesGrowToAnHourAndEndAfterADay) {
  EXPECT_EQ(WebhookPauseMs(1), 30'000);
  EXPECT_EQ(WebhookPauseMs(2), 60'000);
  EXPECT_EQ(WebhookPauseMs(20), 3'600'000);
  int64_t total_ms = 0;
  int attempts = 1;
  for (; WebhookPauseMs(attempts) > 0; ++attempts) total_ms += WebhookPauseMs(attempts);
  EXPECT_GT(total_ms, 23LL * 3'600'000);
  EXPECT_LT(total_ms, 26LL * 3'600'000);
}

}  // namespace
}  // namespace litags
