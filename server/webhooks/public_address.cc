#include "server/webhooks/public_address.h"

#include <arpa/inet.h>
#include <netinet/in.h>

#include <cstdint>
#include <cstring>

namespace litags {
namespace {

struct Range4 {
  uint32_t network;
  int bits;
};

constexpr uint32_t Ip(uint32_t a, uint32_t b, uint32_t c, uint32_t d) {
  return a << 24 | b << 16 | c << 8 | d;
}

// https://www.iana.org/assignments/iana-ipv4-special-registry, with multicast and class E.
constexpr Range4 kNotPublic4[] = {
    {Ip(0, 0, 0, 0), 8},      {Ip(10, 0, 0, 0), 8},     {Ip(100, 64, 0, 0), 10},
    {Ip(127, 0, 0, 0), 8},    {Ip(169, 254, 0, 0), 16}, {Ip(172, 16, 0, 0), 12},
    {Ip(192, 0, 0, 0), 24},   {Ip(192, 0, 2, 0), 24},   {Ip(192, 88, 99, 0), 24},
    {Ip(192, 168, 0, 0), 16}, {Ip(198, 18, 0, 0), 15},  {Ip(198, 51, 100, 0), 24},
    {Ip(203, 0, 113, 0), 24}, {Ip(224, 0, 0, 0), 4},    {Ip(240, 0, 0, 0), 4}};

bool IsPublic4(uint32_t address) {
  for (const Range4& range : kNotPublic4) {
    const uint32_t mask = ~uint32_t{0} << (32 - range.bits);
    if ((address & mask) == range.network) return false;
  }
  return true;
}

uint32_t Word(const uint8_t* bytes) { return Ip(bytes[0], bytes[1], bytes[2], bytes[3]); }

bool IsPublic6(const in6_addr& address) {
  const uint8_t* b = address.s6_addr;
  const uint32_t first = Word(b), second = Word(b + 4), third = Word(b + 8), last = Word(b + 12);
  const bool is_mapped = first == 0 && second == 0 && third == 0xffff;
  const bool is_nat64 = first == 0x0064ff9b && second == 0 && third == 0;
  if (is_mapped || is_nat64) return IsPublic4(last);
  if (first >> 16 == 0x2002) return IsPublic4(first << 16 | second >> 16);  // 6to4
  if (first >> 29 != 1) return false;               // not of 2000::/3, which is all of the internet
  if (first >> 9 == 0x20010000 >> 9) return false;  // 2001::/23: protocols, Teredo among them
  return first != 0x20010db8;                       // documentation
}

}  // namespace

bool IsPublicAddress(const sockaddr* address) {
  if (address->sa_family == AF_INET) {
    sockaddr_in in;
    std::memcpy(&in, address, sizeof(in));
    return IsPublic4(ntohl(in.sin_addr.s_addr));
  }
  if (address->sa_family == AF_INET6) {
    sockaddr_in6 in6;
    std::memcpy(&in6, address, sizeof(in6));
    return IsPublic6(in6.sin6_addr);
  }
  return false;
}

}  // namespace litags
