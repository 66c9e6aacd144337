// What --listen and its like are given.
#ifndef LITAGS_SERVER_NET_ADDRESS_H_
#define LITAGS_SERVER_NET_ADDRESS_H_

#include <string>
#include <string_view>

namespace litags {

struct HostPort {
  std::string host;  // "::1" of "[::1]:50051"
  std::string port;  // empty: there is none
};

// Of HOST:PORT.
HostPort SplitHostPort(std::string_view address);

// "unix:PATH" and "unix-abstract:NAME": gRPC's sockets of this machine, no HOST:PORT.
bool IsUnixSocket(std::string_view address);

}  // namespace litags

#endif  // LITAGS_SERVER_NET_ADDRESS_H_
