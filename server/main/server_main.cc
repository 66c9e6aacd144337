#include "server/main/server_main.h"

#include <CLI/CLI.hpp>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

#include "engine/core/counted.h"
#include "engine/core/error.h"
#include "proto/arguments/arguments.h"
#include "server/auth/tokens.h"
#include "server/jobs/move.h"
#include "server/main/preflight.h"
#include "server/main/serve.h"
#include "server/main/server_flags.h"
#include "server/reader/read_files_main.h"
#include "server/store/file_error.h"
#include "server/store/open_stores.h"
#include "server/worker/log.h"
#include "server/worker/shutdown_signal.h"

namespace litags {
namespace {

namespace fs = std::filesystem;

// Exit codes.
constexpr int kFailed = 1, kUsage = 2;

// The command line.
struct Command {
  CLI::App app{"Reconstructs scenes from badly lit photos, as a gRPC service."};
  ServerFlags flags;
  CLI::App* token;
  std::string client_name;  // of token NAME
  CLI::App* move;
  StorePlaces to;  // of move

  Command() {
    app.set_version_flag("--version", LITAGS_VERSION);
    AddServerFlags(&app, &flags);
    app.footer(
        "Every option but --config, --print-config, --check and --version may also be set by a "
        "variable "
        "(LITAGS_SERVER_MAX_JOBS for --max-jobs) or in the file of --config.");
    token = app.add_subcommand("token", "Make a token for a client, print it, and end");
    token->add_option("NAME", client_name, "Name of the client")->required();
    token->fallthrough();
    move = app.add_subcommand(
        "move", "Copy all jobs and files into other stores, compare, and end; no server may run");
    move->add_option("--to-store", to.jobs, "Where jobs go, as --store")
        ->required()
        ->envname("LITAGS_TO_STORE");
    move->add_option("--to-blobs", to.blobs, "Where photos and scenes go, as --blobs")->required();
    move->add_option("--to-s3-endpoint", to.s3_endpoint, "S3 server of --to-blobs");
    move->fallthrough();
    for (const char* instead : {"--check", "--print-config"}) {
      token->excludes(app.get_option(instead));
      move->excludes(app.get_option(instead));
    }
  }
};

// litags-server move: progress to stderr, the summary to stdout.
absl::Status Move(const ServerFlags& flags, const StorePlaces& to) {
  LITAGS_RETURN_IF_ERROR(to.Validate());
  LITAGS_ASSIGN_OR_RETURN(const DataDir data, DataDir::Open(flags.data));
  LITAGS_ASSIGN_OR_RETURN(const auto lock, DataDirLock::Take(data));
  LITAGS_ASSIGN_OR_RETURN(const MoveSummary moved,
                          MoveInstallation(flags.places, to, data, [](const std::string& text) {
                            std::fprintf(stderr, "checked so far: %s\n", text.c_str());
                          }));
  for (const auto& [table, sum] : moved.rows) {
    std::printf("%s %lld  %s\n", table.c_str(), static_cast<long long>(sum.rows),
                sum.digest.c_str());
  }
  std::printf("blobs %lld, %lld bytes, each read back; %lld copied now\n",
              static_cast<long long>(moved.blobs), static_cast<long long>(moved.blob_bytes),
              static_cast<long long>(moved.blobs_copied));
  if (moved.partial_jobs > 0) {
    std::printf("files of %s have come in part; clients send those again\n",
                Counted(moved.partial_jobs, "job").c_str());
  }
  std::printf("all of it is there twice; start servers on the new stores only\n");
  return absl::OkStatus();
}

// litags-server token NAME: the token to stdout, all else to stderr.
absl::Status PrintNewToken(const std::string& name, const std::string& tokens_path) {
  if (!tokens_path.empty()) {
    LITAGS_ASSIGN_OR_RETURN(const std::string token, AddTokenToFile(name, tokens_path));
    std::printf("%s\n", token.c_str());
    std::fprintf(stderr, "%s can now use this token; only its digest is kept, in %s\n",
                 name.c_str(), tokens_path.c_str());
    return absl::OkStatus();
  }
  LITAGS_RETURN_IF_ERROR(CheckClientName(name, "NAME"));
  const std::string token = MakeToken();
  std::printf("%s\n", token.c_str());
  std::fprintf(stderr, "let the server know it with --token %s\n", TokenEntry(name, token).c_str());
  return absl::OkStatus();
}

// The exit code, after an error is told.
int ExitCode(const absl::Status& status, int failed = kFailed) {
  if (status.ok()) return 0;
  std::fprintf(stderr, "litags-server: %s\n", MessageWithReason(status).c_str());
  return failed;
}

int ServeOrCheck(const ServerFlags& flags, const char* worker_program, EngineFactory make_engine) {
  std::error_code error;
  const fs::path self = fs::read_symlink("/proc/self/exe", error);
  const std::string worker = (self.parent_path() / worker_program).string();
  if (flags.check) return Preflight(flags, worker) ? 0 : kFailed;
  const std::unique_ptr<Engine> engine = make_engine(flags.colmap);
  const ShutdownSignal signal;
  return ExitCode(Serve(flags, worker, engine.get(), signal));
}

}  // namespace

int ServerMain(int argc, char** argv, const char* worker_program, EngineFactory make_engine) {
  if (argc == 2 && argv[1] == std::string_view(kReadFilesCommand)) return ReadFilesMain();
  Command command;
  if (const auto exit = ParseArguments(command.app, argc, argv)) return *exit;
  ServerFlags& flags = command.flags;
  if (const char* config = std::getenv("LITAGS_SERVER_CONFIG"); config && flags.config.empty()) {
    flags.config = config;
  }
  Settings settings(&command.app, ServerSettingsRules());
  if (const absl::Status status = settings.Complete(flags.config); !status.ok()) {
    return ExitCode(status, kUsage);
  }
  if (command.token->parsed()) {
    return ExitCode(PrintNewToken(command.client_name, flags.server.auth.tokens_path));
  }
  const auto log = [&] { return SetUpLog(flags.log_level, flags.log_format, "litags-server"); };
  if (command.move->parsed()) return log() ? ExitCode(Move(flags, command.to)) : kUsage;
  if (flags.print_config) {
    std::fputs(settings.Print().c_str(), stdout);
    return 0;
  }
  if (const absl::Status used = CheckSettingsAreUsed(flags); !used.ok()) {
    return ExitCode(used, kUsage);
  }
  return log() ? ServeOrCheck(flags, worker_program, make_engine) : kUsage;
}

}  // namespace litags
