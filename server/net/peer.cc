#include "server/net/peer.h"

#include <arpa/inet.h>

#include <charconv>
#include <cstring>
#include <utility>

#include "absl/strings/str_cat.h"

namespace litags {
namespace {

// Of in6_addr.
constexpr size_t kIpv6NetworkBytes = 8, kIpv6WiderBytes = 6, kIpv4WiderBytes = 15;

in6_addr Mapped(const in_addr& v4) {
  in6_addr ip = {};
  ip.s6_addr[10] = ip.s6_addr[11] = 0xff;
  std::memcpy(ip.s6_addr + 12, &v4, sizeof(v4));
  return ip;
}

std::string IpText(const in6_addr& ip) {
  char text[INET6_ADDRSTRLEN] = "";
  if (IN6_IS_ADDR_V4MAPPED(&ip)) {
    inet_ntop(AF_INET, ip.s6_addr + 12, text, sizeof(text));
    return text;
  }
  inet_ntop(AF_INET6, &ip, text, sizeof(text));
  return absl::StrCat("[", text, "]");
}

std::string PrefixText(in6_addr ip, size_t bytes) {
  std::memset(ip.s6_addr + bytes, 0, sizeof(ip) - bytes);
  return IpText(ip);
}

std::optional<in6_addr> ParseIp(std::string text) {
  if (const size_t scope = text.find('%'); scope != std::string::npos) text.resize(scope);
  in_addr v4;
  if (inet_pton(AF_INET, text.c_str(), &v4) == 1) return Mapped(v4);
  in6_addr v6;
  if (inet_pton(AF_INET6, text.c_str(), &v6) == 1) return v6;
  return std::nullopt;
}

// gRPC writes them as in a URL.
std::string_view WithoutBrackets(std::string_view host) {
  using namespace std::string_view_literals;
  for (const auto& [open, close] : {std::pair{"%5B"sv, "%5D"sv}, std::pair{"["sv, "]"sv}}) {
    if (host.starts_with(open) && host.ends_with(close) &&
        host.size() > open.size() + close.size()) {
      return host.substr(open.size(), host.size() - open.size() - close.size());
    }
  }
  return host;
}

}  // namespace

std::string Peer::Text() const { return absl::StrCat(IpText(ip), ":", port); }

std::string Peer::Network() const {
  return PrefixText(ip, IN6_IS_ADDR_V4MAPPED(&ip) ? sizeof(ip) : kIpv6NetworkBytes);
}

std::string Peer::WiderNetwork() const {
  return PrefixText(ip, IN6_IS_ADDR_V4MAPPED(&ip) ? kIpv4WiderBytes : kIpv6WiderBytes);
}

bool Peer::IsLoopback() const {
  return IN6_IS_ADDR_LOOPBACK(&ip) || (IN6_IS_ADDR_V4MAPPED(&ip) && ip.s6_addr[12] == 127);
}

std::strong_ordering Peer::operator<=>(const Peer& other) const {
  const int order = std::memcmp(&ip, &other.ip, sizeof(ip));
  return order != 0 ? order <=> 0 : port <=> other.port;
}

std::optional<Peer> PeerOf(const sockaddr_storage& address) {
  if (address.ss_family == AF_INET) {
    const auto& v4 = reinterpret_cast<const sockaddr_in&>(address);
    return Peer{Mapped(v4.sin_addr), ntohs(v4.sin_port)};
  }
  if (address.ss_family == AF_INET6) {
    const auto& v6 = reinterpret_cast<const sockaddr_in6&>(address);
    return Peer{v6.sin6_addr, ntohs(v6.sin6_port)};
  }
  return std::nullopt;
}

std::optional<Peer> ParsePeer(std::string_view name) {
  const size_t scheme = name.find(':'), port_at = name.rfind(':');
  if (scheme == std::string_view::npos || scheme == port_at) return std::nullopt;
  const std::string_view host = name.substr(scheme + 1, port_at - scheme - 1);
  Peer peer;
  const char* const end = name.data() + name.size();
  if (const auto read = std::from_chars(name.data() + port_at + 1, end, peer.port);
      read.ec != std::errc() || read.ptr != end) {
    return std::nullopt;
  }
  const auto ip = ParseIp(std::string(WithoutBrackets(host)));
  if (!ip) return std::nullopt;
  peer.ip = *ip;
  return peer;
}

}  // namespace litags
