#include "server/net/descriptors.h"

#include <sys/resource.h>

#include <algorithm>

namespace litags {
namespace {

// gRPC's, and the duplicate in Connections.
constexpr int kForEach = 2;
// Of four descriptors one is for all else.
constexpr int kShares = 4;
constexpr rlim_t kMost = 1 << 20;

// So many connections the limit leaves room for.
int ConnectionsThatFit() {
  rlimit limit = {};
  if (getrlimit(RLIMIT_NOFILE, &limit) != 0) return 1;
  const int all = static_cast<int>(std::min(limit.rlim_cur, kMost));
  return std::max(1, (all - all / kShares) / kForEach);
}

void RaiseLimit(int connections) {
  rlimit limit = {};
  if (getrlimit(RLIMIT_NOFILE, &limit) != 0) return;
  const rlim_t wanted = static_cast<rlim_t>(connections) * kForEach * kShares / (kShares - 1) + 1;
  limit.rlim_cur = std::max(limit.rlim_cur, std::min(wanted, limit.rlim_max));
  setrlimit(RLIMIT_NOFILE, &limit);  // what fits is asked for afterwards
}

}  // namespace

ConnectionShares ShareDescriptors(ConnectionShares wanted) {
  RaiseLimit(wanted.first + wanted.second);
  const int fit = ConnectionsThatFit();
  const int second = std::min(wanted.second, std::max(fit / 2, fit - wanted.first));
  return {std::min(wanted.first, fit - second), second};
}

}  // namespace litags
