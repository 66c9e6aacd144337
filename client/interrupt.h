#ifndef LITAGS_CLIENT_INTERRUPT_H_
#define LITAGS_CLIENT_INTERRUPT_H_

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <set>

#include "grpcpp/client_context.h"

namespace litags::client {

// Lets Ctrl-C, or another thread, end a call or a pause in progress. Thread-safe.
class Interrupt {
 public:
  // Ends all that runs now, and all that starts later, with CANCELLED.
  void Raise();
  bool raised() const;

  // False if raised before or while sleeping.
  bool Sleep(std::chrono::milliseconds duration);

  // While it lives, Raise() cancels the call of `context`.
  class Scope {
   public:
    Scope(Interrupt& interrupt, grpc::ClientContext& context);
    Scope(const Scope&) = delete;
    Scope& operator=(const Scope&) = delete;
    ~Scope();

   private:
    Interrupt& interrupt_;
    grpc::ClientContext& context_;
  };

 private:
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::set<grpc::ClientContext*> calls_;
  bool raised_ = false;
};

}  // namespace litags::client

#endif  // LITAGS_CLIENT_INTERRUPT_H_
