#include "server/api/server_main.h"

#include <spdlog/spdlog.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/io/file_util.h"
#include "server/api/server.h"
#include "server/jobs/janitor.h"
#include "server/jobs/leases.h"
#include "server/worker/log.h"
#include "server/worker/shutdown_signal.h"
#include "server/worker/supervisor.h"

namespace litags {
namespace {

namespace fs = std::filesystem;

struct Flags {
  ServerOptions server;
  UploadLimits uploads;
  std::string data;
  std::string colmap = "colmap";
  std::string depth_model;
  std::string log_level = "info";
  std::string port_file;
  double sweep_seconds = 60;
  int workers = 1;
  int threads = 0;
  int64_t worker_memory_bytes = 0;
  double colmap_step_seconds = 3600;
  bool worker_network = false;
};

std::string DefaultDataFolder() {
  if (const char* data = std::getenv("LITAGS_DATA"); data && *data) return data;
  const char* home = std::getenv("HOME");
  return absl::StrCat(home && *home ? home : ".", "/.local/share/litags");
}

absl::Status Serve(const Flags& flags, const std::string& worker_program, Engine* engine,
                   const ShutdownSignal& signal) {
  // Found out now, not by jobs that wait for ever.
  if (flags.workers > 0 && access(worker_program.c_str(), X_OK) != 0) {
    return MakeError(absl::StatusCode::kFailedPrecondition, "WORKER_NOT_FOUND", "--workers",
                     absl::StrCat(worker_program,
                                  " is not there or not executable; install it beside "
                                  "litags-server, or start with --workers 0"));
  }
  LITAGS_ASSIGN_OR_RETURN(const DepthNetwork network,
                          DepthNetwork::Parse(flags.depth_model, "--depth-model"));
  if (!network.path.empty() && access(network.path.c_str(), R_OK) != 0) {
    return MakeError(absl::StatusCode::kFailedPrecondition, "DEPTH_MODEL_NOT_FOUND",
                     "--depth-model", absl::StrCat(network.path, " is not there or not readable"));
  }
  LITAGS_ASSIGN_OR_RETURN(const DataDir data, DataDir::Open(flags.data));
  LITAGS_ASSIGN_OR_RETURN(const auto lock, DataDirLock::Take(data));
  data.EmptyTmp(/*quiet_seconds=*/0);
  LITAGS_RETURN_IF_ERROR(CheckSqliteJobStore(data.database()));
  LITAGS_ASSIGN_OR_RETURN(const auto store, OpenSqliteJobStore(data.database()));
  LITAGS_ASSIGN_OR_RETURN(const auto blobs, OpenDiskBlobStore(data.blobs()));
  Jobs jobs(store.get(), blobs.get(), data, SystemClockMs, flags.uploads);
  Leases leases(store.get(), blobs.get());
  LITAGS_ASSIGN_OR_RETURN(const auto server, StartServer(flags.server, &jobs, engine));

  SupervisorOptions workers;
  workers.workers = flags.workers;
  workers.command = {
      worker_program, "--store",    data.root,     "--threads",    absl::StrCat(flags.threads),
      "--colmap",     flags.colmap, "--log-level", flags.log_level};
  workers.command.insert(workers.command.end(),
                         {"--max-memory", absl::StrCat(flags.worker_memory_bytes),
                          "--colmap-timeout", absl::StrCat(flags.colmap_step_seconds)});
  if (flags.worker_network) workers.command.push_back("--allow-network");
  if (!flags.depth_model.empty()) {
    workers.command.insert(workers.command.end(), {"--depth-model", flags.depth_model});
  }
  Supervisor supervisor(workers, &leases);
  const Janitor janitor(&jobs, flags.sweep_seconds);

  const std::string host = flags.server.listen.substr(0, flags.server.listen.rfind(':'));
  std::printf("litags-server listens on %s:%d and stores in %s\n", host.c_str(), server->port(),
              data.root.c_str());
  std::fflush(stdout);
  if (!flags.port_file.empty()) {
    LITAGS_RETURN_IF_ERROR(
        WriteFileAtomically(flags.port_file, absl::StrCat(server->port(), "\n")));
  }
  signal.Wait();
  spdlog::info("shutting down");
  server->Shutdown();
  supervisor.Stop();
  return absl::OkStatus();
}

}  // namespace

int ServerMain(int argc, char** argv, const char* worker_program, EngineFactory make_engine) {
  Flags flags;
  flags.data = DefaultDataFolder();
  CLI::App app{"Reconstructs scenes from badly lit photos, as a gRPC service."};
  app.add_option("--listen", flags.server.listen, "HOST:PORT to listen on; port 0: any free one")
      ->capture_default_str();
  app.add_option("--data", flags.data, "Folder for jobs and scenes (default: $LITAGS_DATA)")
      ->capture_default_str();
  app.add_option("--workers", flags.workers, "Jobs that run at the same time on this machine")
      ->check(CLI::Range(0, 256))
      ->capture_default_str();
  app.add_option("--threads", flags.threads, "Threads per job and per picture; 0: all cores")
      ->check(CLI::NonNegativeNumber);
  app.add_option("--colmap", flags.colmap, "COLMAP program: a name or a path")
      ->capture_default_str();
  app.add_option("--depth-model", flags.depth_model,
                 "ONNX depth network for jobs with depth_source NETWORK: FILE[,size=518x518]"
                 "[,mean=R:G:B][,std=R:G:B][,output=inverse|depth]");
  app.add_option("--colmap-timeout", flags.colmap_step_seconds,
                 "Seconds that one COLMAP step may take; 0: no limit")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  app.add_option("--worker-memory", flags.worker_memory_bytes,
                 "Address space of a worker and of each program it starts, as 6GiB; 0: no limit")
      ->transform(CLI::AsSizeValue(false));
  app.add_flag("--worker-network", flags.worker_network,
               "Leave workers in the machine's network, which they do not need");
  app.add_option("--keep-uploads", flags.uploads.keep_seconds,
                 "Seconds after which a job that was not started, and gets no files, is removed")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  app.add_option("--max-upload-silence", flags.uploads.max_silence_seconds,
                 "Seconds after which an upload that sends nothing is ended; what came is kept")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  app.add_option("--max-job-bytes", flags.uploads.max_job_bytes, "Bytes of all files of a job")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  app.add_option("--sweep-every", flags.sweep_seconds,
                 "Seconds between looks for jobs and files that can be removed")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  app.add_option("--log-level", flags.log_level, "debug, info, warn or error")
      ->capture_default_str();
  app.add_option("--port-file", flags.port_file, "Write the port to this file once it is open");
  CLI11_PARSE(app, argc, argv);
  if (!SetUpLog(flags.log_level, "litags-server")) return 2;
  flags.server.render.threads = flags.threads;

  std::error_code error;
  const fs::path self = fs::read_symlink("/proc/self/exe", error);
  const std::unique_ptr<Engine> engine = make_engine(flags.colmap);
  const ShutdownSignal signal;
  const absl::Status status =
      Serve(flags, (self.parent_path() / worker_program).string(), engine.get(), signal);
  if (!status.ok()) {
    std::fprintf(stderr, "litags-server: %s\n", std::string(status.message()).c_str());
    return 1;
  }
  return 0;
}

}  // namespace litags
