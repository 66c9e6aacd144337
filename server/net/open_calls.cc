#include "server/net/open_calls.h"

#include <linux/tcp.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <algorithm>

namespace litags {
namespace {

// What TLS, HTTP/2 and gRPC add to an upload: some 40 bytes for each 16 KiB, and for each message.
constexpr int64_t kPartAdded = 128, kAddedToMessage = 64;

}  // namespace

int64_t BytesReceived(int socket) {
  tcp_info info = {};
  socklen_t size = sizeof(info);
  if (getsockopt(socket, IPPROTO_TCP, TCP_INFO, &info, &size) != 0) return 0;
  return static_cast<int64_t>(info.tcpi_bytes_received);
}

int64_t OpenCalls::OfConnection::HeldBytes() const {
  if (socket < 0 || unfinished + uploads == 0) return 0;
  return std::max<int64_t>(0, BytesReceived(socket) - bytes_before - bytes_read);
}

bool OpenCalls::Open(uint64_t connection, const std::optional<std::string>& client,
                     Clock::time_point now) {
  const auto [entry, is_new] = all_.try_emplace(connection);
  OfConnection& calls = entry->second;
  if (is_new) calls.began = now;
  if (!calls.client && client) {
    const int open = calls.open;
    AddOpen(calls, -open);
    calls.client = client;
    AddOpen(calls, open);
  }
  if (!RoomFor(calls)) return false;
  if (calls.unfinished + calls.uploads == 0 && calls.socket >= 0) {
    calls.bytes_before = BytesReceived(calls.socket);
    calls.bytes_read = 0;
  }
  if (calls.unfinished == 0) calls.unfinished_since = now;
  ++calls.unfinished;
  AddOpen(calls, 1);
  return true;
}

bool OpenCalls::RoomFor(const OfConnection& calls) const {
  if (calls.open >= (calls.client ? counts_.of_connection : counts_.of_stranger)) return false;
  if (!calls.client || calls.client->empty()) return true;  // without names there are no clients
  const auto of_client = of_clients_.find(*calls.client);
  return of_client == of_clients_.end() || of_client->second < counts_.of_client;
}

void OpenCalls::AddOpen(OfConnection& calls, int count) {
  calls.open += count;
  if (!calls.client || calls.client->empty() || count == 0) return;
  const auto of_client = of_clients_.try_emplace(*calls.client).first;
  of_client->second += count;
  if (of_client->second == 0) of_clients_.erase(of_client);
}

void OpenCalls::Whole(uint64_t connection, bool upload) {
  const auto found = all_.find(connection);
  if (found == all_.end()) return;
  if (found->second.unfinished > 0) --found->second.unfinished;
  if (upload) ++found->second.uploads;
}

void OpenCalls::Read(uint64_t connection, int64_t bytes) {
  const auto found = all_.find(connection);
  if (found == all_.end()) return;
  found->second.bytes_read += bytes + bytes / kPartAdded + kAddedToMessage;
}

void OpenCalls::End(uint64_t connection, bool upload) {
  const auto found = all_.find(connection);
  if (found == all_.end()) return;
  if (upload) --found->second.uploads;
  AddOpen(found->second, -1);
  if (found->second.open == 0 && found->second.socket < 0) Erase(found);
}

const OpenCalls::OfConnection* OpenCalls::Find(uint64_t connection) const {
  const auto found = all_.find(connection);
  return found == all_.end() ? nullptr : &found->second;
}

void OpenCalls::SetSocket(uint64_t connection, int socket) {
  const auto found = all_.find(connection);
  if (found == all_.end()) return;
  found->second.socket = socket;
  found->second.bytes_before = BytesReceived(socket);
}

void OpenCalls::Forget(uint64_t connection) {
  if (const auto found = all_.find(connection); found != all_.end()) Erase(found);
}

void OpenCalls::ForgetUnknown(Clock::time_point then) {
  for (auto entry = all_.begin(); entry != all_.end();) {
    const bool lost = entry->second.socket < 0 && entry->second.began < then;
    entry = lost ? Erase(entry) : std::next(entry);
  }
}

OpenCalls::All::iterator OpenCalls::Erase(All::iterator calls) {
  AddOpen(calls->second, -calls->second.open);
  return all_.erase(calls);
}

}  // namespace litags
