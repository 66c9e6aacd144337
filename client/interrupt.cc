#include "client/interrupt.h"

namespace litags::client {

void Interrupt::Raise() {
  std::lock_guard lock(mutex_);
  raised_ = true;
  for (grpc::ClientContext* call : calls_) call->TryCancel();
  changed_.notify_all();
}

bool Interrupt::raised() const {
  std::lock_guard lock(mutex_);
  return raised_;
}

bool Interrupt::Sleep(std::chrono::milliseconds duration) {
  std::unique_lock lock(mutex_);
  return !changed_.wait_for(lock, duration, [this] { return raised_; });
}

Interrupt::Scope::Scope(Interrupt& interrupt, grpc::ClientContext& context)
    : interrupt_(interrupt), context_(context) {
  std::lock_guard lock(interrupt_.mutex_);
  interrupt_.calls_.insert(&context_);
  if (interrupt_.raised_) context_.TryCancel();
}

Interrupt::Scope::~Scope() {
  std::lock_guard lock(interrupt_.mutex_);
  interrupt_.calls_.erase(&context_);
}

}  // namespace litags::client
