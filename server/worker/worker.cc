#include "server/worker/worker.h"

#include <spdlog/spdlog.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/core/machine_memory.h"
#include "proto/arguments/arguments.h"
#include "server/store/digest.h"
#include "server/store/file_error.h"
#include "server/store/open_stores.h"
#include "server/worker/hardening.h"
#include "server/worker/log.h"
#include "server/worker/presence.h"
#include "server/worker/scratch_folder.h"
#include "server/worker/self_check.h"
#include "server/worker/shutdown_signal.h"

namespace litags {
namespace {

// Until the queue changes, as far as `seen` knows it, or it is time to look anyway: leases run out
// without a word.
void WaitForWork(JobStore* store, const WorkerOptions& options, const CancelToken& shutdown,
                 int64_t* seen) {
  const auto end =
      std::chrono::steady_clock::now() + std::chrono::duration<double>(options.look_seconds);
  while (!shutdown.IsCancelled() && std::chrono::steady_clock::now() < end) {
    const auto token = store->WaitForChange(ChangeTopic::kQueue, *seen, options.poll_seconds);
    if (!token.ok()) return shutdown.SleepFor(0.1);
    if (*token == *seen) continue;
    *seen = *token;
    return;
  }
}

// After `error` of a job that could not be begun, or whose end could not be written: until this
// worker is well, looked at after `pause` seconds, which doubles.
void Rest(const absl::Status& error, const WorkerContext& context, const WorkerOptions& options,
          const CancelToken& shutdown, double* pause) {
  for (bool well = false; !well && !shutdown.IsCancelled();) {
    shutdown.SleepFor(*pause);
    *pause = std::min(2 * *pause, options.max_rest_seconds);
    const absl::Status status = CheckWorkerAfter(error, context);
    well = status.ok();
    if (!well) spdlog::warn("takes no jobs: {}", MessageWithReason(status));
  }
}

// What the operator does not say the worker has, it finds out.
void Complete(const HardeningOptions& hardening, WorkerOptions* options) {
  Resources& has = options->has;
  if (has.cores == 0) has.cores = options->threads > 0 ? options->threads : MachineCores();
  if (has.memory_bytes == 0) has.memory_bytes = MachineMemory();
  if (hardening.max_memory_bytes > 0) {
    has.memory_bytes = std::min(has.memory_bytes, hardening.max_memory_bytes);
  }
  if (!options->depth_network.path.empty()) has.labels.emplace_back(kDepthNetworkLabel);
  has.labels = Sorted(std::move(has.labels));
}

absl::Status OpenAndRun(const DataDir& data, const StorePlaces& places,
                        const WorkerOptions& options, Engine* engine, const CancelToken& shutdown) {
  LITAGS_ASSIGN_OR_RETURN(const auto store, OpenJobStore(places, data));
  LITAGS_ASSIGN_OR_RETURN(const auto blobs, OpenBlobStore(places, data));
  LITAGS_ASSIGN_OR_RETURN(const auto marker, MarkerOf(places, data, store.get(), blobs.get()));
  Leases leases(store.get(), blobs.get());
  const WorkerPresence presence(store.get(), options.name, options.has);
  RunWorker({store.get(), blobs.get(), &leases, engine, data, marker.get()}, options, shutdown);
  return absl::OkStatus();
}

struct Flags {
  std::string data, colmap = "colmap", depth_model, log_level = "info", log_format = "text";
  StorePlaces places;
  double keep_seconds = StorePlaces::kKeepSeconds;
  WorkerOptions options;
  HardeningOptions hardening;
};

void AddOptions(CLI::App* app, Flags* flags) {
  app->add_option("--data", flags->data, "Data folder: of the server, or one of the worker's own")
      ->required();
  app->add_option(
         "--store", flags->places.jobs,
         "Jobs: sqlite:///FILE or postgresql://... (default: litags.db in the data folder)")
      ->envname("LITAGS_STORE");
  app->add_option("--blobs", flags->places.blobs,
                  "Photos, checkpoints, scenes: file:///FOLDER or s3://BUCKET/PREFIX (default: "
                  "blobs/ in the data folder)")
      ->envname("LITAGS_BLOBS");
  app->add_option("--s3-endpoint", flags->places.s3_endpoint, "S3 server, if it is not Amazon's")
      ->envname("LITAGS_S3_ENDPOINT");
  app->add_option("--keep-every", flags->keep_seconds,
                  "Seconds between two times that checkpoint and snapshot are sent to S3")
      ->check(AtLeastZero(flags->keep_seconds))
      ->capture_default_str();
  app->add_option("--name", flags->options.name, "Name, unique among all workers there ever were");
  app->add_option("--threads", flags->options.threads,
                  "Threads per job that does not say; 0: all cores")
      ->check(AtLeastZero(flags->options.threads));
  app->add_option("--cores", flags->options.has.cores,
                  "Cores that jobs may count on; default: those there are, or --threads")
      ->check(AboveZero(flags->options.has.cores))
      ->envname("LITAGS_WORKER_CORES");
  app->add_option("--memory", flags->options.has.memory_bytes,
                  "Main memory that jobs may count on, as 6GiB; default: what there is")
      ->transform(ByteSize())
      ->envname("LITAGS_WORKER_MEMORY");
  app->add_option("--labels", flags->options.has.labels,
                  "What else jobs may ask for, as avx512,site-b")
      ->delimiter(',')
      ->envname("LITAGS_WORKER_LABELS");
  app->add_option("--colmap", flags->colmap, "COLMAP program: a name or a path")
      ->capture_default_str();
  app->add_option("--depth-model", flags->depth_model,
                  "ONNX depth network, see litags-server --help");
  app->add_option("--colmap-timeout", flags->options.colmap_step_seconds,
                  "Seconds that one COLMAP step may take; 0: no limit")
      ->check(AtLeastZero(flags->options.colmap_step_seconds))
      ->capture_default_str();
  app->add_option("--max-memory", flags->hardening.max_memory_bytes,
                  "Address space of the worker and of each program it starts, as 6GiB; 0: no limit")
      ->transform(ByteSize());
  app->add_flag("--allow-network", flags->hardening.allow_network,
                "Stay in the machine's network, which a worker does not need");
  app->add_option("--log-level", flags->log_level, "debug, info, warn or error")
      ->capture_default_str();
  app->add_option("--log-format", flags->log_format, "text or json")
      ->check(OneOf({"text", "json"}))
      ->capture_default_str();
}

}  // namespace

void RunWorker(const WorkerContext& context, const WorkerOptions& options,
               const CancelToken& shutdown) {
  int64_t seen = -1;
  bool store_is_away = false;  // said once
  double pause = options.min_rest_seconds;
  while (!shutdown.IsCancelled()) {
    const auto lease = context.leases->Acquire(options.name, options.has);
    if (!lease.ok()) {
      if (!store_is_away) {
        spdlog::error("cannot look for work: {}", MessageWithReason(lease.status()));
      }
      store_is_away = true;
      shutdown.SleepFor(options.poll_seconds);
      continue;
    }
    if (store_is_away) spdlog::info("can look for work again");
    store_is_away = false;
    if (lease->has_value()) {
      const absl::Status status = RunJob(**lease, context, options, shutdown);
      if (status.ok()) {
        pause = options.min_rest_seconds;
        continue;
      }
      spdlog::error("job={} {}", (*lease)->job.id, MessageWithReason(status));
      Rest(status, context, options, shutdown, &pause);
    } else {
      WaitForWork(context.store, options, shutdown, &seen);
    }
  }
}

int WorkerMain(int argc, char** argv, EngineFactory make_engine) {
  CLI::App app{"Runs the reconstruction jobs of a litags store, one at a time."};
  app.set_version_flag("--version", LITAGS_VERSION);
  Flags flags;
  WorkerOptions& options = flags.options;
  options.name = absl::StrCat("worker-", getpid(), "-", RandomHex(4));
  AddOptions(&app, &flags);
  if (const auto exit = ParseArguments(app, argc, argv)) return *exit;
  if (!SetUpLog(flags.log_level, flags.log_format, options.name)) return 2;
  absl::Status valid = flags.hardening.Validate();
  valid.Update(flags.places.Validate());
  valid.Update(CheckLabels(options.has.labels, "--labels"));
  if (!valid.ok()) {
    spdlog::error("{}", MessageWithReason(valid));
    return 2;
  }
  options.keep_seconds = flags.places.BlobsAreFar() ? flags.keep_seconds : 0;
  if (flags.places.NeedNetwork()) flags.hardening.allow_network = true;
  for (const std::string& refused : HardenProcess(flags.hardening)) {
    spdlog::warn("not hardened as it should be: {}", refused);
  }

  absl::StatusOr<DepthNetwork> network = DepthNetwork::Parse(flags.depth_model, "--depth-model");
  if (!network.ok()) {
    spdlog::error("{}", MessageWithReason(network.status()));
    return 2;
  }
  options.depth_network = *std::move(network);
  Complete(flags.hardening, &options);
  options.give_up = [] { _exit(3); };
  const std::unique_ptr<Engine> engine = make_engine(flags.colmap);
  const ShutdownSignal signal;
  spdlog::info("working on {}", flags.data);
  const auto data = DataDir::Open(flags.data);
  absl::Status status = data.status();
  if (status.ok()) ScratchFolder::RemoveAbandoned(data->scratch());
  if (status.ok()) status = OpenAndRun(*data, flags.places, options, engine.get(), signal.token());
  if (!status.ok()) {
    spdlog::error("{}", MessageWithReason(status));
    return 1;
  }
  spdlog::info("bye");
  return 0;
}

}  // namespace litags
