#include "server/main/serve_web.h"

#include <cstdio>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/io/file_util.h"

namespace litags {

absl::Status CheckWebListening(const ServerFlags& flags) {
  if (flags.web.listen.empty()) return absl::OkStatus();
  LITAGS_RETURN_IF_ERROR(CheckListening(flags.server, flags.web.listen, "--web"));
  if (flags.server.tls.client_ca.empty() || flags.server.auth.enabled()) return absl::OkStatus();
  return MakeError(absl::StatusCode::kFailedPrecondition, "WEB_NEEDS_TOKENS", "--web",
                   "the page knows clients by tokens, and this server by certificates alone; give "
                   "--tokens, or leave out --web");
}

absl::StatusOr<std::unique_ptr<web::WebServer>> ServeWeb(const ServerFlags& flags, Server* server) {
  if (flags.web.listen.empty()) return std::unique_ptr<web::WebServer>();
  LITAGS_RETURN_IF_ERROR(CheckWebListening(flags));
  web::WebOptions options = flags.web;
  options.tls = flags.server.tls;
  options.local_only = !flags.server.auth.enabled() && IsLoopback(options.listen);
  options.counts.newcomer_seconds = flags.server.connections.counts.newcomer_seconds;
  options.keepalive_timeout_seconds = flags.server.connections.keepalive_timeout_seconds;
  options.silence_seconds = flags.uploads.max_silence_seconds;
  options.unread_seconds = flags.server.answers.max_unread_seconds;
  LITAGS_ASSIGN_OR_RETURN(
      auto web, web::WebServer::Start(options, server->InProcessChannel(), server->unread()));
  std::printf("the page is at %s\n", web->url().c_str());
  std::fflush(stdout);
  if (!flags.web_port_file.empty()) {
    LITAGS_RETURN_IF_ERROR(
        WriteFileAtomically(flags.web_port_file, absl::StrCat(web->port(), "\n")));
  }
  return web;
}

}  // namespace litags
