#ifndef LITAGS_SERVER_API_SELF_CALL_H_
#define LITAGS_SERVER_API_SELF_CALL_H_

#include <functional>
#include <string>
#include <thread>

#include "engine/core/cancel.h"
#include "server/auth/tls.h"

namespace litags {

struct SelfCallOptions {
  std::string address;  // HOST:PORT by which this machine reaches the server
  TlsOptions tls;       // the server's own
  double every_seconds = 10;
  double timeout_seconds = 10;  // of one call
  // So many in a row. Patient: a flood may keep out this call as any other, and a restart helps
  // nobody then.
  int failures = 12;
};

// A thread that calls the server by its own address, as a new client would: whatever it is that
// makes a server deaf, a supervisor shall see it. A refusal is an answer, too: a server may ask
// clients for certificates of other issuers than its own. The watch begins with the first answer; a
// server that cannot be reached by itself is not watched.
class SelfCall {
 public:
  // Calls `on_deaf` once, from the thread.
  SelfCall(SelfCallOptions options, std::function<void()> on_deaf);
  ~SelfCall();

 private:
  void Loop();
  bool IsAnswered() const;

  const SelfCallOptions options_;
  const std::function<void()> on_deaf_;
  CancelToken stop_;
  std::thread thread_;
};

}  // namespace litags

#endif  // LITAGS_SERVER_API_SELF_CALL_H_
