#include "server/api/grpc_log.h"

#include <grpc/support/log.h>
#include <spdlog/spdlog.h>

#include <string>
#include <string_view>

#include "absl/strings/str_cat.h"
#include "server/net/line_rate.h"

namespace litags {
namespace {

void Log(gpr_log_func_args* args) {
  std::string_view file = args->file;
  file.remove_prefix(file.rfind('/') + 1);  // npos + 1 is 0
  const std::string place = absl::StrCat(std::string(file), ":", args->line);
  std::string ending;
  if (!CallerLines().Pass("grpc/" + place, &ending)) return;
  spdlog::info("grpc: {} {}{}", place, args->message, ending);
}

}  // namespace

void LogGrpc() { gpr_set_log_function(Log); }

}  // namespace litags
