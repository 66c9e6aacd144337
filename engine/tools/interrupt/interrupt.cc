#include "engine/tools/interrupt/interrupt.h"

#include <csignal>

namespace litags {
namespace {

// Never destroyed: a signal may come while the program ends.
CancelToken& Token() {
  static CancelToken& token = *new CancelToken;
  return token;
}

void OnSignal(int number) {
  Token().Cancel();
  std::signal(number, SIG_DFL);
}

}  // namespace

const CancelToken& CancelOnInterrupt() {
  const CancelToken& token = Token();  // made here, as a signal handler may not
  std::signal(SIGINT, OnSignal);
  std::signal(SIGTERM, OnSignal);
  return token;
}

}  // namespace litags
