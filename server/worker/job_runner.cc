#include "server/worker/job_runner.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <filesystem>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/video/frame_process.h"
#include "server/jobs/codec.h"
#include "server/jobs/jobs.h"
#include "server/store/file_error.h"
#include "server/worker/job_monitor.h"
#include "server/worker/job_reporter.h"
#include "server/worker/self_check.h"
#include "server/worker/while_away.h"
#include "server/worker/work_folder.h"

namespace litags {
namespace {

namespace fs = std::filesystem;

// Lays out the job's files as the engine wants them, with what earlier leases kept; afresh when a
// store was away. CANCELLED before the next file once `cancel` is raised. The names were checked
// when they were uploaded: one component, no leading dot.
absl::StatusOr<ReconstructInput> PrepareInput(const Lease& lease, const WorkerContext& context,
                                              const CancelToken& cancel, WorkFolder* folder) {
  const std::string& job_id = lease.job.id;
  LITAGS_RETURN_IF_ERROR(folder->Fetch(cancel));
  const fs::path input = folder->input();
  const fs::path photos = input / "photos", depths = input / "depths", masks = input / "masks";
  const fs::path colmap = input / "colmap", video = input / "video";
  std::error_code error;
  fs::remove_all(input, error);
  for (const fs::path& made : {photos, depths, masks, colmap, video}) {
    if (!error) fs::create_directories(made, error);
    if (error) return FileError("prepare", made, error.value());
  }
  ReconstructInput result;
  result.images_dir = photos;
  result.work_dir = folder->run();
  LITAGS_ASSIGN_OR_RETURN(const std::vector<FileRecord> files, context.store->Files(job_id));
  for (const FileRecord& file : files) {
    fs::path path;
    switch (file.role) {
      case FileRole::kPhoto:
        path = photos / file.name;
        break;
      case FileRole::kDepth:
        path = depths / file.name;
        result.depth_dir = depths;
        break;
      case FileRole::kMask:
        path = masks / file.name;
        result.masks_dir = masks;
        break;
      case FileRole::kCameras:
        path = input / "transforms.json";
        result.cameras_path = path;
        break;
      case FileRole::kColmap:
        path = colmap / file.name;
        result.cameras_path = colmap;
        break;
      case FileRole::kVideo:
        path = video / file.name;
        result.video_path = path;
        break;
      case FileRole::kArchive:
        continue;  // its files have rows of their own
    }
    LITAGS_RETURN_IF_ERROR(cancel.Check());
    LITAGS_RETURN_IF_ERROR(context.blobs->Fetch(BlobKey(job_id, file.sha256), path));
  }
  // Or an engine that begins now would have had its time to stop already.
  LITAGS_RETURN_IF_ERROR(cancel.Check());
  return result;
}

struct Outcome {
  absl::StatusOr<ReconstructReport> report;
  absl::Status kept;  // whether all that the engine left is in the blob store
  bool engine_ran = false;
};

Outcome Reconstruct(const Lease& lease, const WorkerContext& context, const WorkerOptions& options,
                    const CancelToken& cancel, WorkFolder* folder, JobMonitor* monitor) {
  auto engine_options = Decode<ReconstructOptions>(lease.job.options);
  if (!engine_options.ok()) return {engine_options.status(), absl::OkStatus()};
  if (engine_options->threads == 0 || options.threads > 0) {
    engine_options->threads = engine_options->threads == 0
                                  ? options.threads
                                  : std::min(engine_options->threads, options.threads);
  }
  auto input = WhileAway(cancel, [&] { return PrepareInput(lease, context, cancel, folder); });
  if (!input.ok()) return {input.status(), absl::OkStatus()};
  input->depth_network = options.depth_network;
  input->frame_program = OwnPickFramesProgram();
  input->colmap_step_seconds = options.colmap_step_seconds;
  input->memory_bytes = monitor->max_memory_bytes();
  JobReporter reporter(lease, context, options, folder, [monitor] { monitor->NoteLeaseLost(); });
  Outcome outcome;
  outcome.engine_ran = true;
  monitor->NoteEngineBegins();
  outcome.report = context.engine->Reconstruct(*input, *engine_options, cancel, &reporter);
  monitor->NoteEngineEnded();
  outcome.kept = reporter.Finish(cancel);
  return outcome;
}

// The job is not at fault: it waits for a worker that can begin it. Returns `error`.
absl::Status GiveBackUnbegun(const Lease& lease, const WorkerContext& context,
                             const WorkerOptions& options, const absl::Status& error) {
  const std::string why =
      absl::StrCat("worker ", options.name, " cannot begin jobs now: ", TroubleInWords(error),
                   "; the job waits for a worker that can");
  spdlog::warn("job={} given back: {}", lease.job.id, MessageWithReason(error));
  const absl::Status status = context.leases->GiveBack(lease, 0, why);
  if (!status.ok()) spdlog::error("job={} {}", lease.job.id, MessageWithReason(status));
  return error;
}

// Writes how the lease ended, when the store is there to take it.
absl::Status WriteEnd(const Lease& lease, const WorkerContext& context, const CancelToken& shutdown,
                      const absl::StatusOr<ReconstructReport>& report, WorkFolder* folder,
                      const JobMonitor& monitor, JobMonitor::StopReason stop) {
  Leases& leases = *context.leases;
  const std::string& id = lease.job.id;
  const auto write = [&](auto end) { return WhileAway(shutdown, end); };
  // An engine that finished, or failed, before it saw the token has finished, or failed.
  if (report.ok()) {
    spdlog::info("job={} succeeded gaussians={} seconds={:.1f} kept_bytes={}", id,
                 report->gaussians, report->seconds, folder->stored_bytes());
    const absl::Status ended =
        write([&] { return leases.Succeed(lease, *report, folder->kept()); });
    if (ended.ok()) folder->RemoveReplaced();
    if (!HasReason(ended, "SCENE_MISSING")) return ended;
    spdlog::error("job={} failed: {}", id, MessageWithReason(ended));
    return write([&] { return leases.Fail(lease, ended); });
  }
  if (absl::IsCancelled(report.status()) && stop == JobMonitor::StopReason::kCancelled) {
    spdlog::info("job={} cancelled", id);
    return write([&] { return leases.Stopped(lease); });
  }
  if (absl::IsCancelled(report.status()) && stop == JobMonitor::StopReason::kShutdown) {
    spdlog::info("job={} given back: shutting down", id);
    return leases.GiveBack(lease, monitor.ran_ms());
  }
  if (absl::IsCancelled(report.status()) && stop == JobMonitor::StopReason::kLimit) {
    spdlog::warn("job={} stopped: {}", id, MessageWithReason(monitor.limit_exceeded()));
    return write([&] { return leases.Fail(lease, monitor.limit_exceeded()); });
  }
  spdlog::warn("job={} failed: {}", id, MessageWithReason(report.status()));
  return write([&] { return leases.Fail(lease, report.status()); });
}

}  // namespace

absl::Status RunJob(const Lease& lease, const WorkerContext& context, const WorkerOptions& options,
                    const CancelToken& shutdown) {
  const std::string& id = lease.job.id;
  spdlog::info("job={} attempt={} starts", id, lease.job.attempt);
  CancelToken cancel;
  JobMonitor monitor(lease, context, options, shutdown, cancel);
  auto folder = WorkFolder::Make(lease, context.blobs, context.data.scratch());
  Outcome outcome = folder.ok()
                        ? Reconstruct(lease, context, options, cancel, folder->get(), &monitor)
                        : Outcome{folder.status(), absl::OkStatus()};
  const JobMonitor::StopReason stop = monitor.Finish();
  if (stop == JobMonitor::StopReason::kLeaseLost || absl::IsAborted(outcome.kept)) {
    spdlog::warn("job={} lease lost", id);
    return absl::OkStatus();
  }
  // What a job that is too large for the disk has laid there is no fault of the worker.
  if (!outcome.engine_ran && folder.ok()) folder->reset();
  if (!outcome.engine_ran && IsFaultOfWorker(outcome.report.status(), context)) {
    return GiveBackUnbegun(lease, context, options, outcome.report.status());
  }
  if (!outcome.kept.ok()) {
    spdlog::warn("job={} not all of its files could be kept: {}", id,
                 MessageWithReason(outcome.kept));
    // There is no success without the scene.
    if (outcome.report.ok()) {
      outcome.report = stop == JobMonitor::StopReason::kNone ? outcome.kept : cancel.Check();
    }
  }
  return WriteEnd(lease, context, shutdown, outcome.report, folder.ok() ? folder->get() : nullptr,
                  monitor, stop);
}

}  // namespace litags
