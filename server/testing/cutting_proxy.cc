#include "server/testing/cutting_proxy.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <chrono>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"

namespace litags {
namespace {

// Long enough for the other side to act on what it got.
constexpr std::chrono::milliseconds kTimeToAct{200};

sockaddr_in Loopback(int port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  address.sin_port = htons(static_cast<uint16_t>(port));
  return address;
}

bool SendAll(int fd, const std::string& bytes) {
  for (size_t sent = 0; sent < bytes.size();) {
    const ssize_t n = send(fd, bytes.data() + sent, bytes.size() - sent, MSG_NOSIGNAL);
    if (n <= 0) return false;
    sent += static_cast<size_t>(n);
  }
  return true;
}

}  // namespace

CuttingProxy::CuttingProxy(int to_port) : to_port_(to_port) {
  listener_ = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address = Loopback(0);
  socklen_t size = sizeof(address);
  bind(listener_, reinterpret_cast<sockaddr*>(&address), size);
  listen(listener_, 64);
  getsockname(listener_, reinterpret_cast<sockaddr*>(&address), &size);
  port_ = ntohs(address.sin_port);
  accepter_ = std::thread([this] { Accept(); });
}

CuttingProxy::~CuttingProxy() {
  ends_ = true;
  shutdown(listener_, SHUT_RDWR);
  accepter_.join();
  CutAll();
  for (std::thread& thread : threads_) thread.join();
  close(listener_);
}

std::string CuttingProxy::Through(const std::string& url) const {
  return absl::StrReplaceAll(url,
                             {{absl::StrCat("port=", to_port_), absl::StrCat("port=", port_)}});
}

void CuttingProxy::CutAt(const std::string& text, Cut cut) {
  std::lock_guard lock(mutex_);
  text_ = text;
  cut_ = cut;
  has_cut_ = false;
}

void CuttingProxy::CutAll() {
  std::lock_guard lock(mutex_);
  for (const int fd : sockets_) shutdown(fd, SHUT_RDWR);
}

void CuttingProxy::Accept() {
  while (!ends_) {
    const int client = accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC);
    if (client < 0) continue;
    if (ends_) {
      close(client);
      continue;
    }
    threads_.emplace_back([this, client] { Pass(client); });
  }
}

bool CuttingProxy::IsCut(const std::string& bytes, Cut* cut) {
  std::lock_guard lock(mutex_);
  if (text_.empty() || bytes.find(text_) == std::string::npos) return false;
  text_.clear();
  *cut = cut_;
  has_cut_ = true;
  return true;
}

void CuttingProxy::Pass(int client) {
  const int server = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  const sockaddr_in address = Loopback(to_port_);
  {
    std::lock_guard lock(mutex_);
    sockets_.insert(sockets_.end(), {client, server});
  }
  bool open = connect(server, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0;
  std::string bytes(1 << 16, '\0');
  while (open) {
    pollfd both[] = {{client, POLLIN, 0}, {server, POLLIN, 0}};
    if (poll(both, 2, -1) < 0) break;
    for (int from = 0; from < 2 && open; ++from) {
      if (!both[from].revents) continue;
      const ssize_t n = recv(both[from].fd, bytes.data(), bytes.size(), 0);
      const std::string message(bytes, 0, n > 0 ? static_cast<size_t>(n) : 0);
      Cut cut;
      const bool cuts = from == 0 && IsCut(message, &cut);
      open = n > 0 && !(cuts && cut == kBeforeRequest) && SendAll(both[1 - from].fd, message);
      if (open && cuts) {
        std::this_thread::sleep_for(kTimeToAct);
        open = false;
      }
    }
  }
  std::lock_guard lock(mutex_);
  std::erase_if(sockets_, [&](int fd) { return fd == client || fd == server; });
  close(client);
  close(server);
}

}  // namespace litags
