#ifndef LITAGS_SERVER_JOBS_WEBHOOK_H_
#define LITAGS_SERVER_JOBS_WEBHOOK_H_

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"

namespace litags {

// Who is told when a job has ended, and how that went.
struct Webhook {
  std::string url = {};     // empty: nobody
  std::string secret = {};  // key of the signature
  int attempts = 0;         // since the job ended
  std::string last_error = {};
  int64_t delivered_event = 0;  // number of the event that was delivered last
};

// Where an operator lets webhooks go.
struct WebhookPolicy {
  std::vector<std::string> hosts;  // "hooks.example.com", "*.example.com" or "*"; none: nowhere
  bool internal = false;           // also addresses that are not of the internet, and http
};

// INVALID_ARGUMENT (SETTING_INVALID): one of WebhookPolicy::hosts is none of these three.
absl::Status CheckWebhookHosts(const std::vector<std::string>& hosts);

// INVALID_ARGUMENT (WEBHOOK_INVALID): no https URL of at most 500 bytes with a plain host, without
// user and password, or a secret that has not 16 to 128 bytes. FAILED_PRECONDITION
// (WEBHOOK_NOT_ALLOWED): the operator does not let webhooks go there.
absl::Status CheckWebhook(const Webhook& webhook, const WebhookPolicy& policy);

// "sha256=" and HMAC-SHA256 of "TIMESTAMP.BODY" with the secret, in hex.
std::string WebhookSignature(std::string_view secret, int64_t timestamp, std::string_view body);

// How long after the n-th failed attempt (1, 2, ...) the next one comes, ms: from half a minute,
// twice as much each time, to an hour; 0: there is none, a day or so is over.
int64_t WebhookPauseMs(int attempts);

// No attempt waits until after that. One that does was given its time before the clock was set
// back.
int64_t LatestWebhookMs(int64_t now_ms);

}  // namespace litags

#endif  // LITAGS_SERVER_JOBS_WEBHOOK_H_
