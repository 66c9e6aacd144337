#include "server/net/connections.h"

#include <fcntl.h>
#include <linux/tcp.h>
#include <spdlog/spdlog.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <iterator>
#include <thread>

#include "absl/strings/str_cat.h"
#include "server/net/line_rate.h"

namespace litags {
namespace {

// By what comes in this time newcomers exceed their bytes.
constexpr std::chrono::milliseconds kWithNewcomers{20};
constexpr std::chrono::milliseconds kQuiet{1000};
// gRPC closes what was cut a moment later. While it is behind by so large a part of all
// connections, the next ones wait in the kernel's queue.
constexpr int kPartBehind = 8;
constexpr std::chrono::milliseconds kWhileBehind{5};
constexpr int kMostWaits = 200;

ino_t InodeOf(int fd) {
  struct stat info = {};
  return fstat(fd, &info) == 0 ? info.st_ino : 0;
}

int64_t BytesReceived(int fd) {
  tcp_info info = {};
  socklen_t size = sizeof(info);
  if (getsockopt(fd, IPPROTO_TCP, TCP_INFO, &info, &size) != 0) return 0;
  return static_cast<int64_t>(info.tcpi_bytes_received);
}

}  // namespace

Connections::~Connections() {
  for (const Connection& connection : all_) close(connection.own);
}

Connections::Added Connections::Add(int fd, const Peer& peer) {
  const std::string network = peer.Network();
  std::unique_lock lock(mutex_);
  const int most_cut = std::max(1, counts_.max_connections / kPartBehind);
  for (int waits = 0; cut_ >= most_cut && waits < kMostWaits; ++waits) {
    lock.unlock();
    std::this_thread::sleep_for(kWhileBehind);
    Look();
    lock.lock();
  }
  if (cut_ >= most_cut || !RoomFor(network)) {
    std::string ending;
    if (CallerLines().Pass("full/" + network, &ending)) {
      spdlog::warn("peer={} connection refused: {} are open{}", peer.Text(), all_.size(), ending);
    }
    return Added::kNoRoom;
  }
  const int own = fcntl(fd, F_DUPFD_CLOEXEC, 0);
  if (own < 0) return Added::kNoDescriptors;
  all_.push_back({peer, network, fd, own, InodeOf(own), Clock::now()});
  by_peer_.emplace(peer, std::prev(all_.end()));
  OfNetwork& of_network = networks_[network];
  ++of_network.all;
  ++of_network.newcomers;
  ++newcomers_;
  return Added::kYes;
}

bool Connections::RoomFor(const std::string& network) {
  const auto found = networks_.find(network);
  if (found != networks_.end() && found->second.all >= std::max(1, counts_.max_connections / 2) &&
      !CutOldest(network, "others come from its network")) {
    return false;
  }
  const bool full = static_cast<int>(all_.size()) - cut_ >= counts_.max_connections;
  if (!full && newcomers_ < counts_.max_newcomers) return true;
  return CutOldest(BusiestNetwork(), "others come and it makes no call");
}

std::string Connections::BusiestNetwork() const {
  const auto most = std::max_element(
      networks_.begin(), networks_.end(),
      [](const auto& a, const auto& b) { return a.second.newcomers < b.second.newcomers; });
  return most == networks_.end() ? "" : most->first;
}

bool Connections::CutOldest(const std::string& network, std::string_view why) {
  const auto oldest = std::find_if(all_.begin(), all_.end(), [&](const Connection& connection) {
    return connection.state == State::kNewcomer && connection.network == network;
  });
  if (oldest == all_.end()) return false;
  Cut(*oldest, why);
  return true;
}

void Connections::MakeRoom() {
  std::lock_guard lock(mutex_);
  CutOldest(BusiestNetwork(), "descriptors are short and it makes no call");
}

void Connections::Cut(Connection& connection, std::string_view why) {
  std::string ending;
  if (CallerLines().Pass(absl::StrCat("cut/", connection.network), &ending)) {
    spdlog::info("peer={} connection cut: {}{}", connection.peer.Text(), why, ending);
  }
  shutdown(connection.own, SHUT_RDWR);  // gRPC reads its end, and closes it
  SetState(connection, State::kCut);
}

void Connections::SetState(Connection& connection, State state) {
  OfNetwork& of_network = networks_[connection.network];
  if (connection.state == State::kNewcomer) {
    --newcomers_;
    --of_network.newcomers;
  }
  if (state == State::kCut) {
    ++cut_;
    --of_network.all;
  }
  connection.state = state;
}

void Connections::Admit(std::string_view grpc_peer) {
  const auto peer = ParsePeer(grpc_peer);
  if (peer) Admit(*peer);  // else it calls in process
}

void Connections::Admit(const Peer& peer) {
  std::lock_guard lock(mutex_);
  const auto [begin, end] = by_peer_.equal_range(peer);
  for (auto found = begin; found != end; ++found) {
    Connection& connection = *found->second;
    if (connection.state == State::kNewcomer) SetState(connection, State::kKnown);
  }
}

std::chrono::milliseconds Connections::Look(Clock::time_point now) {
  std::lock_guard lock(mutex_);
  for (auto connection = all_.begin(); connection != all_.end();) {
    // Its number may name something else by now.
    if (InodeOf(connection->fd) != connection->inode) {
      connection = Forget(connection);
      continue;
    }
    if (connection->state == State::kNewcomer) CheckNewcomer(*connection, now);
    ++connection;
  }
  return newcomers_ + cut_ > 0 ? kWithNewcomers : kQuiet;
}

void Connections::CheckNewcomer(Connection& connection, Clock::time_point now) {
  const std::chrono::duration<double> age = now - connection.since;
  const int64_t max_bytes =
      std::min(counts_.newcomer_bytes, counts_.all_newcomers_bytes / std::max(1, newcomers_));
  if (age.count() > counts_.newcomer_seconds) {
    Cut(connection,
        absl::StrCat("it made no call that was let in for ", counts_.newcomer_seconds, " s"));
  } else if (BytesReceived(connection.own) > max_bytes) {
    Cut(connection, absl::StrCat("it sent ", max_bytes >> 10, " KiB before a call was let in"));
  }
}

Connections::List::iterator Connections::Forget(List::iterator connection) {
  if (connection->state != State::kCut) SetState(*connection, State::kCut);
  --cut_;
  const auto [begin, end] = by_peer_.equal_range(connection->peer);
  by_peer_.erase(std::find_if(begin, end, [&](const auto& e) { return e.second == connection; }));
  const auto network = networks_.find(connection->network);
  if (network != networks_.end() && network->second.all == 0) networks_.erase(network);
  close(connection->own);
  return all_.erase(connection);
}

void Connections::CutAll() {
  std::lock_guard lock(mutex_);
  for (Connection& connection : all_) {
    if (connection.state != State::kCut) Cut(connection, "the server ends");
  }
}

int Connections::size() const {
  std::lock_guard lock(mutex_);
  return static_cast<int>(all_.size());
}

int Connections::newcomers() const {
  std::lock_guard lock(mutex_);
  return newcomers_;
}

}  // namespace litags
