#include "server/worker/job_runner.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <filesystem>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "server/jobs/codec.h"
#include "server/jobs/jobs.h"
#include "server/store/file_error.h"
#include "server/worker/job_monitor.h"
#include "server/worker/lease_folder.h"
#include "server/worker/while_away.h"

namespace litags {
namespace {

namespace fs = std::filesystem;

// The folder that held the newest snapshot has just become this lease's.
absl::Status FollowSnapshot(const Lease& lease, const WorkerContext& context, const fs::path& run) {
  if (lease.job.scene_path.empty()) return absl::OkStatus();
  const fs::path scene = run / fs::path(lease.job.scene_path).filename();
  return context.leases->MoveSnapshot(lease, context.data.ToStored(scene));
}

// Lays out the job's files as the engine wants them, afresh, since an earlier attempt may have been
// interrupted here. The names were checked when they were uploaded: one component, no leading dot.
absl::StatusOr<ReconstructInput> PrepareInput(const Lease& lease, const WorkerContext& context) {
  const std::string& job_id = lease.job.id;
  LITAGS_ASSIGN_OR_RETURN(const fs::path folder_of_lease, TakeLeaseFolder(lease, context.data));
  const fs::path input = folder_of_lease / "input", run = folder_of_lease / "run";
  const fs::path photos = input / "photos", depths = input / "depths";
  const fs::path colmap = input / "colmap";
  std::error_code error;
  fs::remove_all(input, error);
  for (const fs::path& folder : {photos, depths, colmap, run}) {
    if (!error) fs::create_directories(folder, error);
    if (error) return FileError("prepare", folder, error.value());
  }
  ReconstructInput result;
  result.images_dir = photos;
  result.work_dir = run;
  LITAGS_RETURN_IF_ERROR(FollowSnapshot(lease, context, run));
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
      case FileRole::kCameras:
        path = input / "transforms.json";
        result.cameras_path = path;
        break;
      case FileRole::kColmap:
        path = colmap / file.name;
        result.cameras_path = colmap;
        break;
      case FileRole::kArchive:
        continue;  // its files have rows of their own
    }
    LITAGS_RETURN_IF_ERROR(context.blobs->Fetch(BlobKey(job_id, file.sha256), path));
  }
  return result;
}

absl::StatusOr<ReconstructReport> Reconstruct(const Lease& lease, const WorkerContext& context,
                                              const WorkerOptions& options,
                                              const CancelToken& cancel,
                                              ReconstructObserver* observer) {
  LITAGS_ASSIGN_OR_RETURN(auto engine_options, Decode<ReconstructOptions>(lease.job.options));
  if (engine_options.threads == 0 || options.threads > 0) {
    engine_options.threads = engine_options.threads == 0
                                 ? options.threads
                                 : std::min(engine_options.threads, options.threads);
  }
  LITAGS_ASSIGN_OR_RETURN(ReconstructInput input,
                          WhileAway(cancel, [&]() -> absl::StatusOr<ReconstructInput> {
                            LITAGS_RETURN_IF_ERROR(cancel.Check());
                            return PrepareInput(lease, context);
                          }));
  input.depth_network = options.depth_network;
  input.colmap_step_seconds = options.colmap_step_seconds;
  return context.engine->Reconstruct(input, engine_options, cancel, observer);
}

// Writes how the lease ended, when the store is there to take it.
absl::Status WriteEnd(const Lease& lease, const WorkerContext& context, const CancelToken& shutdown,
                      const absl::StatusOr<ReconstructReport>& report, const JobMonitor& monitor,
                      JobMonitor::StopReason stop) {
  Leases& leases = *context.leases;
  const std::string& id = lease.job.id;
  const auto write = [&](auto end) { return WhileAway(shutdown, end); };
  // An engine that finished, or failed, before it saw the token has finished, or failed.
  if (report.ok()) {
    spdlog::info("job={} succeeded gaussians={} seconds={:.1f}", id, report->gaussians,
                 report->seconds);
    const std::string scene = context.data.ToStored(report->scene_path);
    return write([&] { return leases.Succeed(lease, *report, scene); });
  }
  if (absl::IsCancelled(report.status()) && stop == JobMonitor::StopReason::kCancelled) {
    spdlog::info("job={} cancelled", id);
    return write([&] { return leases.Stopped(lease); });
  }
  if (absl::IsCancelled(report.status()) && stop == JobMonitor::StopReason::kShutdown) {
    spdlog::info("job={} given back: shutting down", id);
    return leases.GiveBack(lease);
  }
  if (absl::IsCancelled(report.status()) && stop == JobMonitor::StopReason::kLimit) {
    spdlog::warn("job={} stopped: {}", id, monitor.limit_exceeded().ToString());
    return write([&] { return leases.Fail(lease, monitor.limit_exceeded()); });
  }
  if (stop == JobMonitor::StopReason::kLeaseLost) {
    spdlog::warn("job={} lease lost", id);
    return absl::OkStatus();
  }
  spdlog::warn("job={} failed: {}", id, report.status().ToString());
  return write([&] { return leases.Fail(lease, report.status()); });
}

}  // namespace

absl::Status RunJob(const Lease& lease, const WorkerContext& context, const WorkerOptions& options,
                    const CancelToken& shutdown) {
  const std::string& id = lease.job.id;
  spdlog::info("job={} attempt={} starts", id, lease.job.attempt);
  CancelToken cancel;
  JobMonitor monitor(lease, context, options, shutdown, cancel);
  const auto report = Reconstruct(lease, context, options, cancel, &monitor);
  const JobMonitor::StopReason stop = monitor.Finish();
  return WriteEnd(lease, context, shutdown, report, monitor, stop);
}

}  // namespace litags
