#include "server/main/serve.h"

#include <signal.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cstdio>
#include <memory>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "engine/core/error.h"
#include "engine/core/machine_memory.h"
#include "engine/core/sandbox.h"
#include "engine/io/file_util.h"
#include "server/api/convert.h"
#include "server/api/health_monitor.h"
#include "server/api/self_call.h"
#include "server/api/server.h"
#include "server/jobs/janitor.h"
#include "server/jobs/jobs.h"
#include "server/jobs/lease_watch.h"
#include "server/jobs/leases.h"
#include "server/jobs/sweeper.h"
#include "server/main/preflight.h"
#include "server/main/serve_web.h"
#include "server/metrics/metrics_server.h"
#include "server/net/address.h"
#include "server/net/descriptors.h"
#include "server/reader/file_reader.h"
#include "server/reader/read_files_main.h"
#include "server/store/open_stores.h"
#include "server/webhooks/post.h"
#include "server/webhooks/webhook_sender.h"
#include "server/worker/supervisor.h"

namespace litags {
namespace {

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
  const int share = std::max(1, flags.workers);
  int cores = flags.worker_cores;
  if (cores == 0) cores = flags.threads > 0 ? flags.threads : std::max(1, MachineCores() / share);
  pass("--cores", absl::StrCat(cores));
  pass("--memory", absl::StrCat(MachineMemory() / share));
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

std::unique_ptr<WebhookSender> SendWebhooks(const ServerFlags& flags, JobStore* store) {
  if (flags.webhooks.hosts.empty()) return nullptr;
  PostOptions options;
  options.internal = flags.webhooks.internal;
  options.ca_path = flags.webhook_ca;
  return std::make_unique<WebhookSender>(
      store, flags.webhooks, JobToJson,
      [options](const auto& url, const auto& body, const auto& headers) {
        return Post(url, body, headers, options);
      });
}

// What is found out at the start, and not by jobs that wait for ever.
absl::Status CheckFlags(const ServerFlags& flags, const std::string& worker_program) {
  LITAGS_RETURN_IF_ERROR(CheckPrograms(flags, worker_program));
  LITAGS_RETURN_IF_ERROR(
      CheckMetricsListening(flags.metrics_listen, flags.metrics_for_all || flags.server.insecure));
  return CheckWebListening(flags);
}

// Where jobs and files are. The data folder is this process's alone.
struct Stores {
  DataDir data;
  std::unique_ptr<DataDirLock> lock;
  std::unique_ptr<JobStore> jobs;
  std::unique_ptr<BlobStore> blobs;
  std::unique_ptr<InstallationMarker> marker;
};

absl::StatusOr<Stores> OpenStores(const ServerFlags& flags) {
  Stores stores;
  LITAGS_ASSIGN_OR_RETURN(stores.data, DataDir::Open(flags.data));
  const DataDir& data = stores.data;
  if (data.OthersMayEnter()) {
    spdlog::warn("other users of this machine may enter {}: chmod 700 keeps them out", data.root);
  }
  LITAGS_ASSIGN_OR_RETURN(stores.lock, DataDirLock::Take(data));
  data.EmptyTmp(/*quiet_seconds=*/0);
  LITAGS_RETURN_IF_ERROR(CheckJobStore(flags.places, data));
  LITAGS_ASSIGN_OR_RETURN(stores.jobs, OpenJobStore(flags.places, data));
  LITAGS_ASSIGN_OR_RETURN(stores.blobs, OpenBlobStore(flags.places, data));
  LITAGS_RETURN_IF_ERROR(CheckBlobsAreOurs(flags.places, data, stores.blobs.get()));
  LITAGS_ASSIGN_OR_RETURN(stores.marker,
                          ClaimBlobs(flags.places, data, stores.jobs.get(), stores.blobs.get()));
  return stores;
}

// Null without --metrics-listen.
absl::StatusOr<std::unique_ptr<MetricsServer>> ServeMetrics(const ServerFlags& flags,
                                                            Metrics* counted, JobStore* store) {
  if (flags.metrics_listen.empty()) return std::unique_ptr<MetricsServer>();
  LITAGS_ASSIGN_OR_RETURN(auto metrics, MetricsServer::Start(flags.metrics_listen, counted, store));
  spdlog::info("metrics at port {}, /metrics", metrics->port());
  return metrics;
}

// Says where clients find the server, and opens the page, which is null without --web.
absl::StatusOr<std::unique_ptr<web::WebServer>> Announce(const ServerFlags& flags,
                                                         const DataDir& data, Server* server) {
  std::string listen = flags.server.listen;
  if (!IsUnixSocket(listen)) {  // its port may have been 0
    listen = absl::StrCat(listen.substr(0, listen.rfind(':') + 1), server->port());
  }
  std::printf("litags-server listens on %s and stores in %s\n", listen.c_str(), data.root.c_str());
  std::fflush(stdout);
  LITAGS_ASSIGN_OR_RETURN(auto web, ServeWeb(flags, server));
  if (!flags.port_file.empty()) {
    LITAGS_RETURN_IF_ERROR(
        WriteFileAtomically(flags.port_file, absl::StrCat(server->port(), "\n")));
  }
  return web;
}

void Allow(int connections, ConnectionCounts* counts) {
  if (connections < counts->max_connections) {
    spdlog::warn("the limit of open files leaves room for {} connections, not {}; raise it",
                 connections, counts->max_connections);
  }
  counts->max_connections = std::max(1, connections);
  counts->max_newcomers = std::clamp(connections / 2, 1, counts->max_newcomers);
}

// Connections of both ports share the descriptors.
void FitConnections(ServerFlags* flags) {
  ConnectionCounts& grpc = flags->server.connections.counts;
  ConnectionCounts& page = flags->web.counts;
  const bool has_page = !flags->web.listen.empty();
  const ConnectionShares fit =
      ShareDescriptors({grpc.max_connections, has_page ? page.max_connections : 0});
  Allow(fit.first, &grpc);
  if (has_page) Allow(fit.second, &page);
}

}  // namespace

absl::Status Serve(ServerFlags flags, const std::string& worker_program, Engine* engine,
                   const ShutdownSignal& signal) {
  HideFromOtherProcesses();
  LITAGS_RETURN_IF_ERROR(CheckFlags(flags, worker_program));
  FitConnections(&flags);
  LITAGS_ASSIGN_OR_RETURN(const Stores stores, OpenStores(flags));
  UploadLimits uploads = flags.uploads;
  if (!flags.places.blobs.empty()) uploads.chunk_bytes = kUploadChunkBytes;  // maybe shared
  Jobs jobs(stores.jobs.get(), stores.blobs.get(), stores.data, StoreClock(stores.jobs.get()),
            uploads, flags.webhooks);
  Sweeper sweeper(stores.jobs.get(), stores.blobs.get(), &jobs.uploads(), stores.data,
                  StoreClock(stores.jobs.get()), stores.marker.get(), AwakeClockMs);
  Leases leases(stores.jobs.get(), stores.blobs.get());
  const auto reader = MakeRemoteReader({"/proc/self/exe", kReadFilesCommand});
  ServerOptions options = flags.server;
  options.reader = reader.get();
  LITAGS_ASSIGN_OR_RETURN(const auto server, StartServer(options, &jobs, engine));
  LITAGS_ASSIGN_OR_RETURN(const auto metrics,
                          ServeMetrics(flags, server->metrics(), stores.jobs.get()));
  SupervisorOptions workers = WorkersOf(flags, worker_program, stores.data);
  workers.on_restart = [&] { server->metrics()->AddWorkerRestart(); };
  Supervisor supervisor(workers, &leases);
  auto health = std::make_unique<HealthMonitor>(
      &jobs, flags.places.LocalFolders(stores.data), [&] { return supervisor.AllFailing(); },
      server.get());
  const Janitor janitor(&sweeper, flags.sweep_seconds);
  const LeaseWatch lease_watch(&leases);
  const auto webhooks = SendWebhooks(flags, stores.jobs.get());
  LITAGS_ASSIGN_OR_RETURN(const auto web, Announce(flags, stores.data, server.get()));
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

}  // namespace litags
