#include "server/net/connections.h"

#include <fcntl.h>
#include <spdlog/spdlog.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <iterator>
#include <thread>
#include <utility>

#include "absl/strings/str_cat.h"
#include "server/net/line_rate.h"

namespace litags {
namespace {

// By what comes in this time newcomers exceed their bytes.
constexpr std::chrono::milliseconds kWithNewcomers{20};
constexpr std::chrono::milliseconds kQuiet{100};
// gRPC closes what was cut a moment later. While it is behind by so large a part of all
// connections, the next ones wait in the kernel's queue.
constexpr int kPartBehind = 8;
constexpr std::chrono::milliseconds kWhileBehind{5};
constexpr int kMostWaits = 200;
// One client may have so large a part of all connections.
constexpr int kPartOfClient = 4;
constexpr size_t kMostDiscarded = 1 << 20;
// Of requests that gRPC refused, as compressed ones, nobody hears an end. With so few bytes those
// that have not ended are taken for such: their connection may stay, and they count as open calls.
constexpr int64_t kLostBytes = 16 << 10;
// Between two looks at a crowd of strangers.
constexpr std::chrono::milliseconds kBetweenCuts{1};

// One less of `who`.
void Uncount(std::map<std::string, int>& counts, const std::string& who) {
  const auto found = counts.find(who);
  if (--found->second == 0) counts.erase(found);
}

ino_t InodeOf(int fd) {
  struct stat info = {};
  return fstat(fd, &info) == 0 ? info.st_ino : 0;
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
  if (cut_ >= most_cut || !RoomFor(peer, network)) {
    std::string ending;
    if (CallerLines().Pass("full/" + network, &ending)) {
      spdlog::warn("peer={} connection refused: {} are open{}", peer.Text(), all_.size(), ending);
    }
    return Added::kNoRoom;
  }
  const int own = fcntl(fd, F_DUPFD_CLOEXEC, 0);
  if (own < 0) return Added::kNoDescriptors;
  all_.push_back({peer, network, peer.WiderNetwork(), fd, own, InodeOf(own), Clock::now()});
  by_peer_.emplace(peer, std::prev(all_.end()));
  OfNetwork& of_network = networks_[network];
  ++of_network.all;
  ++of_network.newcomers;
  ++newcomers_of_wider_[all_.back().wider_network];
  ++newcomers_;
  return Added::kYes;
}

bool Connections::RoomFor(const Peer& peer, const std::string& network) {
  const auto found = networks_.find(network);
  if (found != networks_.end() && found->second.all >= std::max(1, counts_.max_connections / 2) &&
      !CutOldest(network, "others come from its network")) {
    return false;
  }
  const bool full = static_cast<int>(all_.size()) - cut_ >= counts_.max_connections;
  if (!full && newcomers_ < counts_.max_newcomers) return true;
  return CutNewcomer(peer.IsLoopback(), "others come and it makes no call");
}

bool Connections::CutNewcomer(bool of_loopback_too, std::string_view why) {
  Connection* worst = nullptr;
  std::pair<int, int> most;
  for (Connection& connection : all_) {
    if (connection.state != State::kNewcomer) continue;
    if (!of_loopback_too && connection.peer.IsLoopback()) continue;
    const std::pair from_there(newcomers_of_wider_.at(connection.wider_network),
                               networks_.at(connection.network).newcomers);
    if (worst && from_there <= most) continue;
    worst = &connection;
    most = from_there;
  }
  if (worst) Cut(*worst, why);
  return worst != nullptr;
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
  CutNewcomer(/*of_loopback_too=*/true, "descriptors are short and it makes no call");
}

void Connections::Cut(Connection& connection, std::string_view why) {
  std::string ending;
  if (CallerLines().Pass(absl::StrCat("cut/", connection.network), &ending)) {
    spdlog::info("peer={} connection cut: {}{}", connection.peer.Text(), why, ending);
  }
  shutdown(connection.own, SHUT_RDWR);  // gRPC reads its end, and closes it
  // What has come and gRPC has not read yet costs nothing more.
  while (recv(connection.own, nullptr, kMostDiscarded, MSG_DONTWAIT | MSG_TRUNC) > 0) {
  }
  SetState(connection, State::kCut);
}

void Connections::SetState(Connection& connection, State state) {
  OfNetwork& of_network = networks_[connection.network];
  if (connection.state == State::kNewcomer) {
    --newcomers_;
    --of_network.newcomers;
    Uncount(newcomers_of_wider_, connection.wider_network);
  }
  if (state == State::kCut) {
    ++cut_;
    --of_network.all;
    if (!connection.client.empty()) Uncount(of_clients_, connection.client);
  }
  connection.state = state;
}

Connections::Connection* Connections::Find(std::string_view grpc_peer) {
  const auto peer = ParsePeer(grpc_peer);
  return peer ? Find(*peer) : nullptr;  // else it calls in process
}

Connections::Connection* Connections::Find(const Peer& peer) {
  const auto [begin, end] = by_peer_.equal_range(peer);
  const auto found = std::find_if(
      begin, end, [](const auto& entry) { return entry.second->state != State::kCut; });
  return found == end ? nullptr : &*found->second;
}

void Connections::Admit(std::string_view grpc_peer, const std::string& client) {
  const auto peer = ParsePeer(grpc_peer);
  if (peer) Admit(*peer, client);  // else it calls in process
}

void Connections::Admit(const Peer& peer, const std::string& client) {
  std::lock_guard lock(mutex_);
  Connection* const connection = Find(peer);
  if (!connection || connection->state != State::kNewcomer) return;
  SetState(*connection, State::kKnown);
  if (client.empty()) return;  // without names there are no clients
  MakeRoomOf(client);
  connection->client = client;
  ++of_clients_[client];
}

void Connections::MakeRoomOf(const std::string& client) {
  const auto count = of_clients_.find(client);
  const int most = std::max(1, counts_.max_connections / kPartOfClient);
  if (count == of_clients_.end() || count->second < most) return;
  const auto first = [&](bool busy_too) {
    return std::find_if(all_.begin(), all_.end(), [&](const Connection& connection) {
      return connection.state == State::kKnown && connection.client == client &&
             (busy_too || !HasCalls(connection));
    });
  };
  const auto idle = first(/*busy_too=*/false);
  Cut(idle != all_.end() ? *idle : *first(/*busy_too=*/true), "its client has too many");
}

bool Connections::HasCalls(const Connection& connection) const {
  const auto* const calls = connection.number ? calls_.Find(*connection.number) : nullptr;
  return calls && calls->open > 0;
}

bool Connections::OpenCall(uint64_t connection, const std::optional<std::string>& client) {
  const auto now = Clock::now();
  std::lock_guard lock(mutex_);
  if (!client) CountStranger(now);
  return calls_.Open(connection, client, now);
}

void Connections::WholeCall(uint64_t number, std::string_view grpc_peer, bool upload) {
  std::lock_guard lock(mutex_);
  calls_.Whole(number, upload);
  const OpenCalls::OfConnection* const calls = calls_.Find(number);
  if (!calls || calls->socket >= 0) return;
  Connection* const connection = Find(grpc_peer);
  if (!connection) return;
  connection->number = number;
  calls_.SetSocket(number, connection->own);
}

void Connections::ReadOfCall(uint64_t connection, int64_t bytes) {
  std::lock_guard lock(mutex_);
  calls_.Read(connection, bytes);
}

void Connections::EndCall(uint64_t connection, bool upload) {
  std::lock_guard lock(mutex_);
  calls_.End(connection, upload);
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
    if (connection->state == State::kKnown) CheckUnfinished(*connection, now);
    ++connection;
  }
  calls_.ForgetUnknown(now - std::chrono::duration_cast<Clock::duration>(
                                 std::chrono::duration<double>(2 * counts_.newcomer_seconds)));
  const bool unfinished = CheckUnfinishedBytes();
  return newcomers_ + cut_ > 0 || unfinished ? kWithNewcomers : kQuiet;
}

void Connections::CheckUnfinished(Connection& connection, Clock::time_point now) {
  const auto* const calls = connection.number ? calls_.Find(*connection.number) : nullptr;
  if (!calls || calls->unfinished == 0) return;
  const std::chrono::duration<double> age = now - calls->unfinished_since;
  if (age.count() <= counts_.calls.unfinished_seconds) return;
  if (calls->HeldBytes() <= kLostBytes) {
    for (int lost = calls->unfinished; lost > 0; --lost) calls_.Whole(*connection.number, false);
    return;
  }
  Cut(connection,
      absl::StrCat("a request did not end for ", counts_.calls.unfinished_seconds, " s"));
}

void Connections::Sent::Add(int64_t sent, Connection* connection) {
  bytes += sent;
  connections.emplace(sent, connection);
}

bool Connections::CheckUnfinishedBytes() {
  SentBy sent;
  for (Connection& connection : all_) {
    if (connection.state != State::kKnown || !connection.number) continue;
    const auto* const calls = calls_.Find(*connection.number);
    const int64_t bytes = calls ? calls->HeldBytes() : 0;
    if (bytes == 0) continue;
    const bool named = calls->client && !calls->client->empty();
    sent[named ? *calls->client : connection.network].Add(bytes, &connection);
  }
  const bool any = !sent.empty();
  CutMost(std::move(sent), counts_.calls.unfinished_bytes, counts_.calls.unfinished_bytes / 2,
          "of requests that have not ended, and their room is used up");
  return any;
}

void Connections::CountStranger(Clock::time_point now) {
  const std::chrono::duration<double> since = now - strangers_counted_;
  strangers_counted_ = now;
  strangers_calls_ = 1 + std::max(0.0, strangers_calls_ - since.count() * counts_.crowd_calls);
  if (strangers_calls_ <= counts_.crowd_calls || now - crowd_cut_ < kBetweenCuts) return;
  crowd_cut_ = now;
  SentBy sent;
  for (Connection& connection : all_) {
    if (connection.state != State::kNewcomer) continue;
    sent[connection.network].Add(BytesReceived(connection.own), &connection);
  }
  CutMost(std::move(sent), counts_.crowd_bytes, counts_.crowd_bytes,
          "while strangers opened very many calls");
}

void Connections::CutMost(SentBy sent, int64_t most_of_all, int64_t most_of_one, const char* why) {
  int64_t all = 0;
  for (const auto& [who, of_one] : sent) all += of_one.bytes;
  while (!sent.empty()) {
    const auto worst = std::max_element(sent.begin(), sent.end(), [](const auto& a, const auto& b) {
      return a.second.bytes < b.second.bytes;
    });
    Sent& of_one = worst->second;
    if (all <= most_of_all && of_one.bytes <= most_of_one) return;
    const auto most = std::prev(of_one.connections.end());
    const auto [bytes, connection] = *most;
    Cut(*connection, absl::StrCat("it sent ", bytes >> 10, " KiB ", why));
    of_one.connections.erase(most);
    of_one.bytes -= bytes;
    all -= bytes;
    if (of_one.connections.empty()) sent.erase(worst);
  }
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
  if (connection->number) calls_.Forget(*connection->number);
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
