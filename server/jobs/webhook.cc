#include "server/jobs/webhook.h"

#include <openssl/evp.h>
#include <openssl/hmac.h>

#include <algorithm>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "engine/core/error.h"
#include "server/store/digest.h"

namespace litags {
namespace {

constexpr size_t kMaxUrlBytes = 500, kMinSecretBytes = 16, kMaxSecretBytes = 128;
constexpr int64_t kFirstPauseMs = 30'000, kLongestPauseMs = 3'600'000;
constexpr int64_t kClocksDifferMs = 60'000;  // those of two servers, by less than that
constexpr int kMaxAttempts = 30;             // 23 of them an hour apart

absl::Status Bad(const char* field, std::string_view why) {
  return InvalidInput("WEBHOOK_INVALID", field, absl::StrCat(field, ": ", std::string(why)));
}

// The host of "SCHEME://HOST[:PORT][/...]", in lower case; empty if that is not plain.
std::string HostOf(std::string_view rest) {
  rest = rest.substr(0, rest.find_first_of("/?#"));
  if (const size_t colon = rest.rfind(':'); colon != std::string_view::npos) {
    const std::string_view port = rest.substr(colon + 1);
    if (port.empty() || port.size() > 5 ||
        !std::all_of(port.begin(), port.end(), absl::ascii_isdigit)) {
      return "";
    }
    rest = rest.substr(0, colon);
  }
  const bool plain = !rest.empty() && std::all_of(rest.begin(), rest.end(), [](char c) {
    return absl::ascii_isalnum(c) || c == '.' || c == '-';
  });
  return plain ? absl::AsciiStrToLower(std::string(rest)) : "";
}

bool IsAllowed(const std::string& host, const std::vector<std::string>& patterns) {
  return std::any_of(patterns.begin(), patterns.end(), [&](const std::string& pattern) {
    const std::string lower = absl::AsciiStrToLower(pattern);
    if (lower == "*" || lower == host) return true;
    return lower.starts_with("*.") && host.ends_with(lower.substr(1));
  });
}

}  // namespace

absl::Status CheckWebhookHosts(const std::vector<std::string>& hosts) {
  for (const std::string& pattern : hosts) {
    const std::string host = pattern.substr(pattern.starts_with("*.") ? 2 : 0);
    const bool is_host = !host.empty() && HostOf(host) == absl::AsciiStrToLower(host);
    if (pattern == "*" || (is_host && host[0] != '.')) continue;
    return InvalidInput("SETTING_INVALID", "--webhook-hosts",
                        absl::StrCat("--webhook-hosts: \"", pattern,
                                     "\" is neither a host, as hooks.example.com, nor \"*.HOST\", "
                                     "nor \"*\"; give it without https://, port, path and blanks"));
  }
  return absl::OkStatus();
}

absl::Status CheckWebhook(const Webhook& webhook, const WebhookPolicy& policy) {
  const std::string& url = webhook.url;
  if (url.empty() && webhook.secret.empty()) return absl::OkStatus();
  if (url.empty()) return Bad("webhook.url", "is empty; a secret alone tells nobody");
  if (url.size() > kMaxUrlBytes) return Bad("webhook.url", "more than 500 bytes");
  if (!std::all_of(url.begin(), url.end(), absl::ascii_isgraph)) {
    return Bad("webhook.url", "holds what a URL cannot hold; percent-encode it");
  }
  const bool https = url.starts_with("https://"), http = url.starts_with("http://");
  if (!https && !(http && policy.internal)) return Bad("webhook.url", "must begin with https://");
  const std::string host = HostOf(std::string_view(url).substr(https ? 8 : 7));
  if (host.empty()) {
    return Bad("webhook.url", "must be https://HOST[:PORT]/PATH, without user and password");
  }
  if (webhook.secret.size() < kMinSecretBytes || webhook.secret.size() > kMaxSecretBytes) {
    return Bad("webhook.secret", "must have 16 to 128 bytes, best random ones as hex digits");
  }
  if (IsAllowed(host, policy.hosts)) return absl::OkStatus();
  return MakeError(absl::StatusCode::kFailedPrecondition, "WEBHOOK_NOT_ALLOWED", "webhook.url",
                   policy.hosts.empty()
                       ? std::string("webhook.url: this server tells nobody of finished jobs; ask "
                                     "its operator for --webhook-hosts, or use WatchJob")
                       : absl::StrCat("webhook.url: this server's webhooks go to ",
                                      absl::StrJoin(policy.hosts, ", "), " only, not to ", host));
}

std::string WebhookSignature(std::string_view secret, int64_t timestamp, std::string_view body) {
  const std::string text = absl::StrCat(timestamp, ".", std::string(body));
  unsigned char digest[EVP_MAX_MD_SIZE];
  unsigned int length = 0;
  HMAC(EVP_sha256(), secret.data(), static_cast<int>(secret.size()),
       reinterpret_cast<const unsigned char*>(text.data()), text.size(), digest, &length);
  return absl::StrCat("sha256=",
                      ToHex(std::string_view(reinterpret_cast<const char*>(digest), length)));
}

int64_t WebhookPauseMs(int attempts) {
  if (attempts >= kMaxAttempts) return 0;
  return std::min(kLongestPauseMs, kFirstPauseMs << std::clamp(attempts - 1, 0, 10));
}

int64_t LatestWebhookMs(int64_t now_ms) { return now_ms + kLongestPauseMs + kClocksDifferMs; }

}  // namespace litags
