#ifndef LITAGS_SERVER_WEBHOOKS_PUBLIC_ADDRESS_H_
#define LITAGS_SERVER_WEBHOOKS_PUBLIC_ADDRESS_H_

#include <sys/socket.h>

namespace litags {

// Whether the address is one of the internet: not of this machine, a private or local network, a
// multicast group, or reserved (IANA's special-purpose registries, RFC 6890). An IPv6 address that
// holds an IPv4 one (mapped, NAT64, 6to4) is as that one.
bool IsPublicAddress(const sockaddr* address);

}  // namespace litags

#endif  // LITAGS_SERVER_WEBHOOKS_PUBLIC_ADDRESS_H_
