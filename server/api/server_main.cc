#include "server/api/server_main.h"

#include <google/protobuf/util/json_util.h>
#include <signal.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <cstdio>
#include <filesystem>
#include <string>
#include <string_view>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "engine/core/counted.h"
#include "engine/core/error.h"
#include "engine/core/sandbox.h"
#include "engine/io/file_util.h"
#include "proto/arguments/arguments.h"
#include "server/api/convert.h"
#include "server/api/health_monitor.h"
#include "server/api/preflight.h"
#include "server/api/self_call.h"
#include "server/api/serve_web.h"
#include "server/api/server.h"
#include "server/api/server_flags.h"
#include "server/auth/tokens.h"
#include "server/jobs/janitor.h"
#include "server/jobs/leases.h"
#include "server/jobs/move.h"
#include "server/metrics/metrics_server.h"
#include "server/net/descriptors.h"
#include "server/reader/file_reader.h"
#include "server/reader/read_files_main.h"
#include "server/store/open_stores.h"
#include "server/webhooks/webhook_sender.h"
#include "server/worker/log.h"
#include "server/worker/machine.h"
#include "server/worker/shutdown_signal.h"
#include "server/worker/supervisor.h"

namespace litags {
namespace {

namespace fs = std::filesystem;

// Costs one request to S3 for so much of a large file, and so much is sent again if another server
// takes over.
constexpr int64_t kUploadChunkBytes = int64_t{8} << 20;

SupervisorOptions WorkersOf(const ServerFlags& flags, const std::string& worker_program,
                            const DataDir& data) {
  SupervisorOptions workers;
  workers.workers = flags.workers;
  workers.niceness = flags.worker_niceness;
  // Their last checkpoints go over a network; systemd and Compose kill us after 30 s.
  if (flags.places.BlobsAreFar()) workers.grace_seconds = 20;
  std::vector<std::string>& command = workers.command;
  command = {worker_program};
  const auto pass = [&](const char* name, const std::string& value) {
    command.insert(command.end(), {name, value});
  };
  pass("--data", data.root);
  // Not as arguments: the store's URL may hold a password.
  workers.env = flags.places.Environment();
  pass("--threads", absl::StrCat(flags.threads));
  const Resources found = FoundResources();
  const int share = std::max(1, flags.workers);
  int cores = flags.worker_cores;
  if (cores == 0) cores = flags.threads > 0 ? flags.threads : std::max(1, found.cores / share);
  pass("--cores", absl::StrCat(cores));
  pass("--memory", absl::StrCat(found.memory_bytes / share));
  if (!flags.worker_labels.empty()) {
    pass("--labels", absl::StrJoin(Sorted(flags.worker_labels), ","));
  }
  pass("--colmap", flags.colmap);
  pass("--colmap-timeout", absl::StrCat(flags.colmap_step_seconds));
  pass("--keep-every", absl::StrCat(flags.keep_seconds));
  pass("--max-memory", absl::StrCat(flags.worker_memory_bytes));
  if (flags.worker_network) command.push_back("--allow-network");
  if (!flags.depth_model.empty()) pass("--depth-model", flags.depth_model);
  pass("--log-level", flags.log_level);
  pass("--log-format", flags.log_format);
  return workers;
}

// A server that does not answer ends as on SIGTERM, but with an error, for a supervisor to see.
std::unique_ptr<SelfCall> WatchListener(const ServerFlags& flags, const Server& server,
                                        std::atomic<bool>* deaf) {
  if (flags.self_call_seconds <= 0 || server.own_address().empty()) return nullptr;
  // What made it deaf may also keep it from ending.
  constexpr int kSecondsToEnd = 60;
  SelfCallOptions options;
  options.address = server.own_address();
  options.tls = flags.server.tls;
  options.every_seconds = flags.self_call_seconds;
  return std::make_unique<SelfCall>(options, [deaf] {
    spdlog::error("the server does not answer itself any more, and ends");
    *deaf = true;
    alarm(kSecondsToEnd);
    kill(getpid(), SIGTERM);
  });
}

// The job as GetJob has it, as JSON.
absl::StatusOr<std::string> WebhookBody(const JobRecord& job) {
  LITAGS_ASSIGN_OR_RETURN(const v1::Job proto, JobToProto(job));
  std::string body;
  if (google::protobuf::util::MessageToJsonString(proto, &body).ok()) return body;
  return absl::InternalError("the job cannot be written as JSON");
}

std::unique_ptr<WebhookSender> SendWebhooks(const ServerFlags& flags, JobStore* store) {
  if (flags.webhooks.hosts.empty()) return nullptr;
  PostOptions options;
  options.internal = flags.webhooks.internal;
  options.ca_path = flags.webhook_ca;
  return std::make_unique<WebhookSender>(
      store, flags.webhooks, WebhookBody,
      [options](const auto& url, const auto& body, const auto& headers) {
        return Post(url, body, headers, options);
      });
}

absl::Status Serve(const ServerFlags& flags, const std::string& worker_program, Engine* engine,
                   const ShutdownSignal& signal) {
  HideFromOtherProcesses();
  // Found out now, not by jobs that wait for ever.
  LITAGS_RETURN_IF_ERROR(CheckPrograms(flags, worker_program));
  LITAGS_RETURN_IF_ERROR(
      CheckMetricsListening(flags.metrics_listen, flags.metrics_for_all || flags.server.insecure));
  LITAGS_RETURN_IF_ERROR(CheckWebListening(flags));
  RaiseDescriptorLimit(flags.server.connections.counts.max_connections +
                       (flags.web.listen.empty() ? 0 : flags.web.counts.max_connections));
  LITAGS_ASSIGN_OR_RETURN(const DataDir data, DataDir::Open(flags.data));
  if (data.OthersMayEnter()) {
    spdlog::warn("other users of this machine may enter {}: chmod 700 keeps them out", data.root);
  }
  LITAGS_ASSIGN_OR_RETURN(const auto lock, DataDirLock::Take(data));
  data.EmptyTmp(/*quiet_seconds=*/0);
  LITAGS_RETURN_IF_ERROR(CheckJobStore(flags.places, data));
  LITAGS_ASSIGN_OR_RETURN(const auto store, OpenJobStore(flags.places, data));
  LITAGS_ASSIGN_OR_RETURN(const auto blobs, OpenBlobStore(flags.places, data));
  LITAGS_RETURN_IF_ERROR(CheckBlobsAreOurs(flags.places, data, blobs.get()));
  LITAGS_ASSIGN_OR_RETURN(const auto marker, ClaimBlobs(flags.places, store.get(), blobs.get()));
  UploadLimits uploads = flags.uploads;
  if (!flags.places.blobs.empty()) uploads.chunk_bytes = kUploadChunkBytes;  // maybe shared
  Jobs jobs(store.get(), blobs.get(), data, StoreClock(store.get()), uploads, flags.webhooks,
            marker.get(), AwakeClockMs);
  Leases leases(store.get(), blobs.get());
  const auto reader = MakeRemoteReader({"/proc/self/exe", kReadFilesCommand});
  ServerOptions options = flags.server;
  options.reader = reader.get();
  LITAGS_ASSIGN_OR_RETURN(const auto server, StartServer(options, &jobs, engine));
  std::unique_ptr<MetricsServer> metrics;
  if (!flags.metrics_listen.empty()) {
    LITAGS_ASSIGN_OR_RETURN(metrics,
                            MetricsServer::Start(flags.metrics_listen, server->metrics(), &jobs));
    spdlog::info("metrics at port {}, /metrics", metrics->port());
  }
  SupervisorOptions workers = WorkersOf(flags, worker_program, data);
  workers.on_restart = [&] { server->metrics()->AddWorkerRestart(); };
  Supervisor supervisor(workers, &leases);
  auto health = std::make_unique<HealthMonitor>(
      &jobs, flags.places.LocalFolders(data), [&] { return supervisor.AllFailing(); },
      server.get());
  const Janitor janitor(&jobs, flags.sweep_seconds);
  const auto webhooks = SendWebhooks(flags, store.get());

  const std::string host = flags.server.listen.substr(0, flags.server.listen.rfind(':'));
  std::printf("litags-server listens on %s:%d and stores in %s\n", host.c_str(), server->port(),
              data.root.c_str());
  std::fflush(stdout);
  LITAGS_ASSIGN_OR_RETURN(const auto web, ServeWeb(flags, server.get()));
  if (!flags.port_file.empty()) {
    LITAGS_RETURN_IF_ERROR(
        WriteFileAtomically(flags.port_file, absl::StrCat(server->port(), "\n")));
  }
  std::atomic<bool> deaf = false;
  auto self_call = WatchListener(flags, *server, &deaf);
  signal.Wait();
  spdlog::info("shutting down");
  self_call.reset();
  health.reset();
  supervisor.BeginStop();  // they need as long as the calls
  if (web) web->Stop();
  server->Shutdown();
  supervisor.Stop();
  if (!deaf) return absl::OkStatus();
  return MakeError(absl::StatusCode::kUnavailable, "SERVER_DEAF", "--listen",
                   absl::StrCat("the server did not answer itself at ", flags.server.listen,
                                " and ended; start it again"));
}

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

int Fail(const absl::Status& status) {
  std::fprintf(stderr, "litags-server: %s\n", MessageWithReason(status).c_str());
  return 1;
}

}  // namespace

int ServerMain(int argc, char** argv, const char* worker_program, EngineFactory make_engine) {
  if (argc == 2 && argv[1] == std::string_view(kReadFilesCommand)) return ReadFilesMain();
  ServerFlags flags;
  CLI::App app{"Reconstructs scenes from badly lit photos, as a gRPC service."};
  app.set_version_flag("--version", LITAGS_VERSION);
  AddServerFlags(&app, &flags);
  app.footer(
      "Every option but --config, --print-config, --check and --version may also be set by a "
      "variable "
      "(LITAGS_SERVER_MAX_JOBS for --max-jobs) or in the file of --config.");
  std::string client_name;
  CLI::App* token = app.add_subcommand("token", "Make a token for a client, print it, and end");
  token->add_option("NAME", client_name, "Name of the client")->required();
  token->fallthrough();
  StorePlaces to;
  CLI::App* move = app.add_subcommand(
      "move", "Copy all jobs and files into other stores, compare, and end; no server may run");
  move->add_option("--to-store", to.jobs, "Where jobs go, as --store")
      ->required()
      ->envname("LITAGS_TO_STORE");
  move->add_option("--to-blobs", to.blobs, "Where photos and scenes go, as --blobs")->required();
  move->add_option("--to-s3-endpoint", to.s3_endpoint, "S3 server of --to-blobs");
  move->fallthrough();
  if (const auto exit = ParseArguments(app, argc, argv)) return *exit;

  if (const char* config = std::getenv("LITAGS_SERVER_CONFIG"); config && flags.config.empty()) {
    flags.config = config;
  }
  Settings settings(&app, ServerSettingsRules());
  if (const absl::Status status = settings.Complete(flags.config); !status.ok()) {
    Fail(status);
    return 2;
  }
  if (token->parsed()) {
    const absl::Status status = PrintNewToken(client_name, flags.server.auth.tokens_path);
    return status.ok() ? 0 : Fail(status);
  }
  if (move->parsed()) {
    if (!SetUpLog(flags.log_level, flags.log_format, "litags-server")) return 2;
    const absl::Status status = Move(flags, to);
    return status.ok() ? 0 : Fail(status);
  }
  if (flags.print_config) {
    std::fputs(settings.Print().c_str(), stdout);
    return 0;
  }
  if (const absl::Status used = CheckSettingsAreUsed(flags); !used.ok()) {
    Fail(used);
    return 2;
  }
  if (!SetUpLog(flags.log_level, flags.log_format, "litags-server")) return 2;
  std::error_code error;
  const fs::path self = fs::read_symlink("/proc/self/exe", error);
  const std::string worker = (self.parent_path() / worker_program).string();
  if (flags.check) return Preflight(flags, worker) ? 0 : 1;

  const std::unique_ptr<Engine> engine = make_engine(flags.colmap);
  const ShutdownSignal signal;
  const absl::Status status = Serve(flags, worker, engine.get(), signal);
  return status.ok() ? 0 : Fail(status);
}

}  // namespace litags
