#include "server/webhooks/webhook_sender.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <random>
#include <utility>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "server/jobs/codec.h"
#include "server/jobs/state_machine.h"
#include "server/store/file_error.h"

namespace litags {
namespace {

constexpr int kClientsPerLook = 1000;
constexpr int64_t kClaimMs = 60'000;  // longer than an attempt takes
constexpr double kSecondsBetweenLooks = 1;

// Changes the webhook of a job whose row is locked.
absl::Status Change(JobTransaction& job, const std::function<void(Webhook&)>& change) {
  LITAGS_ASSIGN_OR_RETURN(Webhook webhook, WebhookOf(job.job));
  change(webhook);
  job.job.webhook = Encode(webhook);
  return absl::OkStatus();
}

}  // namespace

// The right to send for a client, until this is gone.
class WebhookSender::Turn {
 public:
  explicit Turn(WebhookSender* sender) : sender_(sender) {}
  ~Turn() {
    if (!taken_) return;
    const std::lock_guard lock(sender_->mutex_);
    const auto mine = sender_->sending_.find(client_);
    if (--mine->second == 0) sender_->sending_.erase(mine);
  }
  Turn(const Turn&) = delete;
  Turn& operator=(const Turn&) = delete;

  // False: as many as may already send for the client. May be called again: the store repeats
  // transactions.
  bool Take(const std::string& client) {
    if (taken_) return true;
    const std::lock_guard lock(sender_->mutex_);
    int& sending = sender_->sending_[client];
    if (sending >= sender_->most_of_client_) return false;
    ++sending;
    client_ = client;
    return taken_ = true;
  }

 private:
  WebhookSender* const sender_;
  std::string client_;
  bool taken_ = false;
};

WebhookSender::WebhookSender(JobStore* store, WebhookPolicy policy, Body body, Send send,
                             int threads)
    : store_(store),
      policy_(std::move(policy)),
      body_(std::move(body)),
      send_(std::move(send)),
      most_of_client_(std::max(1, threads - 1)) {
  for (int i = 0; i < threads; ++i) threads_.emplace_back([this] { Loop(); });
}

WebhookSender::~WebhookSender() {
  stop_.Cancel();
  for (std::thread& thread : threads_) thread.join();
}

void WebhookSender::Loop() {
  while (!stop_.IsCancelled()) {
    const auto sent = SendDue();
    if (!sent.ok()) spdlog::warn("webhooks wait: {}", MessageWithReason(sent.status()));
    if (sent.ok() && *sent > 0) continue;
    stop_.SleepFor(kSecondsBetweenLooks);
  }
}

absl::StatusOr<int> WebhookSender::SendDue() {
  int sent = 0;
  const int64_t now_ms = store_->NowMs();
  LITAGS_ASSIGN_OR_RETURN(std::vector<std::string> ids,
                          store_->WebhooksDue(now_ms, LatestWebhookMs(now_ms), kClientsPerLook));
  // No client is always the first.
  std::shuffle(ids.begin(), ids.end(), std::minstd_rand(std::random_device()()));
  for (const std::string& id : ids) {
    if (stop_.IsCancelled()) break;
    const auto mine = SendOne(id);
    if (absl::IsNotFound(mine.status())) continue;  // deleted meanwhile
    LITAGS_RETURN_IF_ERROR(mine.status());
    sent += *mine;
  }
  return sent;
}

absl::StatusOr<bool> WebhookSender::SendOne(const std::string& id) {
  Turn turn(this);
  bool mine = false;
  LITAGS_ASSIGN_OR_RETURN(const JobRecord job, store_->Update(id, [&](JobTransaction& taken) {
    const int64_t now_ms = store_->NowMs();
    int64_t& due_ms = taken.job.webhook_due_ms;
    const bool due = due_ms > 0 && (due_ms <= now_ms || due_ms > LatestWebhookMs(now_ms));
    mine = due && turn.Take(taken.job.owner);
    if (!mine) return absl::OkStatus();
    mine = IsTerminal(taken.job.state);
    due_ms = mine ? now_ms + kClaimMs : 0;
    return absl::OkStatus();
  }));
  if (!mine) return false;
  LITAGS_ASSIGN_OR_RETURN(const Webhook webhook, WebhookOf(job));
  // The operator may have said since where webhooks go. Another server may allow what this one does
  // not, as when they get a new list one after the other: so that counts as an attempt, too.
  const absl::Status allowed = CheckWebhook(webhook, policy_);
  const absl::Status status = allowed.ok() ? Tell(job, webhook) : allowed;
  LITAGS_RETURN_IF_ERROR(
      store_
          ->Update(id,
                   [&](JobTransaction& sent) -> absl::Status {
                     // It went on, and ended again, while the first end was told: that waits for
                     // its own turn.
                     if (sent.job.last_event != job.last_event) return absl::OkStatus();
                     int attempts = 0;
                     LITAGS_RETURN_IF_ERROR(Change(sent, [&](Webhook& hook) {
                       attempts = ++hook.attempts;
                       hook.last_error = status.ok() ? "" : std::string(status.message());
                       if (status.ok()) hook.delivered_event = job.last_event;
                     }));
                     const int64_t pause_ms = status.ok() ? 0 : WebhookPauseMs(attempts);
                     sent.job.webhook_due_ms = pause_ms > 0 ? store_->NowMs() + pause_ms : 0;
                     return absl::OkStatus();
                   })
          .status());
  spdlog::info("job={} webhook {}", id, status.ok() ? "delivered" : MessageWithReason(status));
  return true;
}

absl::Status WebhookSender::Tell(const JobRecord& job, const Webhook& webhook) const {
  LITAGS_ASSIGN_OR_RETURN(const std::string body, body_(job));
  const int64_t now = store_->NowMs() / 1000;
  return send_(webhook.url, body,
               {{"Content-Type", "application/json"},
                {"Litags-Event", absl::StrCat("jobs/", job.id, "/", job.last_event)},
                {"Litags-Timestamp", absl::StrCat(now)},
                {"Litags-Signature", WebhookSignature(webhook.secret, now, body)}});
}

}  // namespace litags
