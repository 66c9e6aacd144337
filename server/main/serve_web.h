#ifndef LITAGS_SERVER_MAIN_SERVE_WEB_H_
#define LITAGS_SERVER_MAIN_SERVE_WEB_H_

#include <memory>

#include "absl/status/statusor.h"
#include "server/api/server.h"
#include "server/main/server_flags.h"
#include "server/web/web_server.h"

namespace litags {

// OK if --web may be served: errors of CheckListening(); FAILED_PRECONDITION (WEB_NEEDS_TOKENS) if
// clients are known by certificates alone, which do not pass the gateway.
absl::Status CheckWebListening(const ServerFlags& flags);

// The page at --web, over `server`'s services; null without that setting. Errors of the above and
// of WebServer::Start().
absl::StatusOr<std::unique_ptr<web::WebServer>> ServeWeb(const ServerFlags& flags, Server* server);

}  // namespace litags

#endif  // LITAGS_SERVER_MAIN_SERVE_WEB_H_
