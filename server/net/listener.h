#ifndef LITAGS_SERVER_NET_LISTENER_H_
#define LITAGS_SERVER_NET_LISTENER_H_

#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "absl/status/statusor.h"
#include "server/net/connections.h"

namespace litags {

// Takes TCP connections at an address, in a thread of its own.
class Listener {
 public:
  // `address`: HOST:PORT, port 0: any free one; connections wait until Start(). A peer that
  // acknowledges nothing for `unacknowledged_seconds` is given up. UNAVAILABLE (CANNOT_LISTEN),
  // with the setting `flag` that has the address.
  static absl::StatusOr<std::unique_ptr<Listener>> Open(const std::string& address,
                                                        double unacknowledged_seconds,
                                                        std::string_view flag = "--listen");
  ~Listener();  // Stop()

  int port() const { return port_; }
  // HOST:PORT where this machine reaches it.
  const std::string& own_address() const { return own_address_; }

  // Every connection that `connections`, which must outlive this, have room for goes to `take`,
  // which owns the socket from then on.
  void Start(Connections* connections, std::function<void(int listener, int fd)> take);
  // `take` is not called any more, and nobody listens.
  void Stop();

 private:
  Listener() = default;
  absl::Status Listen(const std::string& address, int unacknowledged_ms, std::string_view flag);
  void Loop();
  bool Accept(int listener);
  void WaitForDescriptors(const char* why);

  std::vector<int> sockets_;
  int port_ = 0;
  std::string own_address_;
  Connections* connections_ = nullptr;
  std::function<void(int, int)> take_;
  int stop_ = -1;  // eventfd
  std::thread thread_;
};

}  // namespace litags

#endif  // LITAGS_SERVER_NET_LISTENER_H_
