#ifndef LITAGS_SERVER_WEBHOOKS_POST_H_
#define LITAGS_SERVER_WEBHOOKS_POST_H_

#include <sys/socket.h>

#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"

namespace litags {

struct PostOptions {
  bool internal = false;        // also to addresses that are not of the internet, and without TLS
  double timeout_seconds = 10;  // of all of it
  std::string ca_path;          // certificates that servers are checked by; empty: the system's
  // Addresses that may be reached, in tests; null: all if `internal`, else IsPublicAddress().
  bool (*may_reach)(const sockaddr*) = nullptr;
};

// Sends `body` to `url` and reads the answer's status, nothing else. Follows no redirect and uses
// no proxy; the address is checked when the connection is made, whatever the name meant before. OK
// for 2xx; UNAVAILABLE (WEBHOOK_FAILED) for all else, saying what.
absl::Status Post(const std::string& url, const std::string& body,
                  const std::vector<std::pair<std::string, std::string>>& headers,
                  const PostOptions& options);

}  // namespace litags

#endif  // LITAGS_SERVER_WEBHOOKS_POST_H_
