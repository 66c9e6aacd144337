#ifndef LITAGS_SERVER_NET_PEER_H_
#define LITAGS_SERVER_NET_PEER_H_

#include <netinet/in.h>
#include <sys/socket.h>

#include <compare>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace litags {

// The other end of a TCP connection.
struct Peer {
  in6_addr ip = {};  // IPv4 as ::ffff:a.b.c.d
  uint16_t port = 0;

  // "192.0.2.7:4711", "[2001:db8::7]:4711"; for logs.
  std::string Text() const;
  // Who it is for limits: an IPv4 address, or the /64 that one household has of IPv6.
  std::string Network() const;
  // What one stranger may well have whole: an IPv4 /24 or an IPv6 /48.
  std::string WiderNetwork() const;
  // Of this machine.
  bool IsLoopback() const;

  bool operator==(const Peer& other) const { return (*this <=> other) == 0; }
  std::strong_ordering operator<=>(const Peer& other) const;
};

// nullopt if it is no IP address.
std::optional<Peer> PeerOf(const sockaddr_storage& address);
// Of the name that gRPC gives it: "ipv4:192.0.2.7:4711", "ipv6:%5B2001:db8::7%5D:4711"; brackets
// may be plain.
std::optional<Peer> ParsePeer(std::string_view grpc_name);

// The header by which a call in process says for whom it is made: Peer::Text().
inline constexpr char kPeerHeader[] = "litags-peer";

}  // namespace litags

#endif  // LITAGS_SERVER_NET_PEER_H_
