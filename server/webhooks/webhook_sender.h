// Tells those who asked for it that a job has ended.
#ifndef LITAGS_SERVER_WEBHOOKS_WEBHOOK_SENDER_H_
#define LITAGS_SERVER_WEBHOOKS_WEBHOOK_SENDER_H_

#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "engine/core/cancel.h"
#include "server/jobs/webhook.h"
#include "server/store/job_store.h"

namespace litags {

// Threads that send what is due: one POST for each end of a job, with these headers:
//   Litags-Event      jobs/ID/NUMBER: the event that is told, the same in every attempt
//   Litags-Timestamp  seconds since 1970
//   Litags-Signature  WebhookSignature() of timestamp and body
// Senders of several servers share the work: what one has taken is its own for a minute. An end is
// told again only if its receiver did not say 2xx, or the sender died before it could note that.
// A job that goes on before its end could be told tells of its next end. Receivers that hang keep
// the threads of one client busy: one thread is left to the others.
class WebhookSender {
 public:
  // The body that tells of a job.
  using Body = std::function<absl::StatusOr<std::string>(const JobRecord&)>;
  // How it is sent; Post() but for tests.
  using Send =
      std::function<absl::Status(const std::string& url, const std::string& body,
                                 const std::vector<std::pair<std::string, std::string>>& headers)>;

  // `store` must outlive this. What `policy` does not allow, or does not allow any more, is not
  // sent; it waits as after an attempt that failed, for a server that allows it.
  WebhookSender(JobStore* store, WebhookPolicy policy, Body body, Send send, int threads = 4);
  ~WebhookSender();

  // Does what is due first of each client; returns how much that was. For tests, with 0 threads.
  absl::StatusOr<int> SendDue();

 private:
  class Turn;

  void Loop();
  // False: another one has it, or too many threads send for its client.
  absl::StatusOr<bool> SendOne(const std::string& id);
  absl::Status Tell(const JobRecord& job, const Webhook& webhook) const;

  JobStore* const store_;
  const WebhookPolicy policy_;
  const Body body_;
  const Send send_;
  const int most_of_client_;  // threads that send for it at one time
  std::mutex mutex_;
  std::map<std::string, int> sending_;  // threads, by client
  CancelToken stop_;
  std::vector<std::thread> threads_;
};

}  // namespace litags

#endif  // LITAGS_SERVER_WEBHOOKS_WEBHOOK_SENDER_H_
