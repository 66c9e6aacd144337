#include "server/worker/shutdown_signal.h"

#include <signal.h>

#include <chrono>
#include <thread>

namespace litags {
namespace {

// Raising the token is a store to a lock-free atomic, which a signal handler may do.
static_assert(std::atomic<bool>::is_always_lock_free);

CancelToken& Token() {
  static CancelToken token;
  return token;
}

void OnSignal(int) { Token().Cancel(); }

void Handle(void (*handler)(int)) {
  struct sigaction action = {}, before = {};
  action.sa_handler = handler;
  action.sa_flags = SA_RESTART;
  sigaction(SIGTERM, &action, nullptr);
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGHUP, nullptr, &before);
  if (before.sa_handler != SIG_IGN) sigaction(SIGHUP, &action, nullptr);
}

}  // namespace

ShutdownSignal::ShutdownSignal() {
  Token() = CancelToken();
  signal(SIGPIPE, SIG_IGN);
  Handle(OnSignal);
}

ShutdownSignal::~ShutdownSignal() { Handle(SIG_DFL); }

const CancelToken& ShutdownSignal::token() const { return Token(); }

void ShutdownSignal::Wait() const {
  while (!Token().IsCancelled()) std::this_thread::sleep_for(std::chrono::milliseconds(50));
}

}  // namespace litags
