#include "server/net/listener.h"

#include <netdb.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <spdlog/spdlog.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "server/net/address.h"
#include "server/net/line_rate.h"
#include "server/net/peer.h"

namespace litags {
namespace {

// Between two looks at the connections that are there.
constexpr int kAtOnce = 64;
constexpr std::chrono::milliseconds kPause{100};

struct Freer {
  void operator()(addrinfo* list) const { freeaddrinfo(list); }
};

bool HasIpv6() {
  const int fd = socket(AF_INET6, SOCK_STREAM | SOCK_CLOEXEC, 0);
  if (fd >= 0) close(fd);
  return fd >= 0;
}

bool Bind(int fd, const addrinfo& place, int port, int unacknowledged_ms) {
  const int on = 1, off = 0;
  sockaddr_storage address = {};
  std::memcpy(&address, place.ai_addr, place.ai_addrlen);
  if (place.ai_family == AF_INET6) {
    setsockopt(fd, IPPROTO_IPV6, IPV6_V6ONLY, &off, sizeof(off));
    reinterpret_cast<sockaddr_in6&>(address).sin6_port = htons(static_cast<uint16_t>(port));
  } else {
    reinterpret_cast<sockaddr_in&>(address).sin_port = htons(static_cast<uint16_t>(port));
  }
  // Accepted sockets inherit them.
  setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &on, sizeof(on));
  setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof(on));
  setsockopt(fd, IPPROTO_TCP, TCP_USER_TIMEOUT, &unacknowledged_ms, sizeof(unacknowledged_ms));
  return bind(fd, reinterpret_cast<const sockaddr*>(&address), place.ai_addrlen) == 0 &&
         listen(fd, SOMAXCONN) == 0;
}

// The port of a bound socket, and how this machine reaches it.
Peer BoundTo(int fd) {
  sockaddr_storage address = {};
  socklen_t size = sizeof(address);
  getsockname(fd, reinterpret_cast<sockaddr*>(&address), &size);
  Peer bound = PeerOf(address).value_or(Peer());
  const bool any = IN6_IS_ADDR_UNSPECIFIED(&bound.ip) || bound.Network() == "0.0.0.0";
  if (any) bound.ip = ParsePeer("ipv4:127.0.0.1:1")->ip;
  return bound;
}

}  // namespace

absl::StatusOr<std::unique_ptr<Listener>> Listener::Open(const std::string& address,
                                                         double unacknowledged_seconds,
                                                         std::string_view flag) {
  std::unique_ptr<Listener> listener(new Listener);
  LITAGS_RETURN_IF_ERROR(
      listener->Listen(address, static_cast<int>(1000 * unacknowledged_seconds), flag));
  return listener;
}

Listener::~Listener() { Stop(); }

absl::Status Listener::Listen(const std::string& address, int unacknowledged_ms,
                              std::string_view flag) {
  const auto failed = [&](const std::string& why) {
    return MakeError(
        absl::StatusCode::kUnavailable, "CANNOT_LISTEN", flag,
        absl::StrCat("cannot listen on ", address, " (", why,
                     "); is another server running there? choose another ", std::string(flag)));
  };
  auto [host, port] = SplitHostPort(address);
  if (host.empty() || port.empty()) return failed("it is not of the form HOST:PORT");
  // As gRPC has it: any address is any of both kinds.
  if (host == "0.0.0.0" && HasIpv6()) host = "::";
  addrinfo hints = {};
  hints.ai_socktype = SOCK_STREAM;
  hints.ai_flags = AI_PASSIVE | AI_NUMERICSERV;
  addrinfo* found = nullptr;
  int error = getaddrinfo(host.c_str(), port.c_str(), &hints, &found);
  if (error != 0) return failed(gai_strerror(error));
  const std::unique_ptr<addrinfo, Freer> list(found);
  port_ = std::atoi(port.c_str());
  for (const addrinfo* place = list.get(); place; place = place->ai_next) {
    const int fd = socket(place->ai_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (fd >= 0 && Bind(fd, *place, port_, unacknowledged_ms)) {
      const Peer bound = BoundTo(fd);
      port_ = bound.port;
      if (sockets_.empty()) own_address_ = bound.Text();
      sockets_.push_back(fd);
      continue;
    }
    error = errno;
    if (fd >= 0) close(fd);
    // "localhost" is two addresses, and a machine may lack one kind.
    if (error != EADDRNOTAVAIL && error != EAFNOSUPPORT) return failed(std::strerror(error));
  }
  return sockets_.empty() ? failed(std::strerror(error)) : absl::OkStatus();
}

void Listener::Start(Connections* connections, std::function<void(int, int)> take) {
  connections_ = connections;
  take_ = std::move(take);
  stop_ = eventfd(0, EFD_CLOEXEC);
  thread_ = std::thread([this] { Loop(); });
}

void Listener::Stop() {
  if (thread_.joinable()) {
    eventfd_write(stop_, 1);
    thread_.join();
    close(stop_);
  }
  for (const int fd : sockets_) close(fd);
  sockets_.clear();
}

void Listener::Loop() {
  std::vector<pollfd> waits = {{stop_, POLLIN, 0}};
  for (const int fd : sockets_) waits.push_back({fd, POLLIN, 0});
  while (true) {
    const auto timeout = connections_->Look();
    poll(waits.data(), waits.size(), static_cast<int>(timeout.count()));
    if (waits[0].revents != 0) return;
    for (size_t i = 1; i < waits.size(); ++i) {
      for (int n = 0; n < kAtOnce && waits[i].revents != 0 && Accept(waits[i].fd); ++n) {
      }
    }
  }
}

// Whether there may be more.
bool Listener::Accept(int listener) {
  sockaddr_storage address = {};
  socklen_t size = sizeof(address);
  const int fd =
      accept4(listener, reinterpret_cast<sockaddr*>(&address), &size, SOCK_NONBLOCK | SOCK_CLOEXEC);
  if (fd < 0) {
    const int error = errno;
    if (error == EAGAIN || error == EWOULDBLOCK) return false;
    if (error == EMFILE || error == ENFILE || error == ENOBUFS || error == ENOMEM) {
      WaitForDescriptors(std::strerror(error));
      return false;
    }
    return true;  // of the one connection that was to come: it is gone already
  }
  const auto added = connections_->Add(fd, PeerOf(address).value_or(Peer()));
  if (added == Connections::Added::kYes) {
    take_(listener, fd);
    return true;
  }
  close(fd);
  if (added == Connections::Added::kNoDescriptors) WaitForDescriptors("for a duplicate");
  return added == Connections::Added::kNoRoom;
}

void Listener::WaitForDescriptors(const char* why) {
  std::string ending;
  if (CallerLines().Pass("accept", &ending)) {
    spdlog::error("cannot take a connection ({}); trying again{}", why, ending);
  }
  connections_->MakeRoom();
  pollfd wait = {stop_, POLLIN, 0};
  poll(&wait, 1, static_cast<int>(kPause.count()));
}

}  // namespace litags
