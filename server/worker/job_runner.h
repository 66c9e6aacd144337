// One leased job: files in place, engine on, its reports into the store.
#ifndef LITAGS_SERVER_WORKER_JOB_RUNNER_H_
#define LITAGS_SERVER_WORKER_JOB_RUNNER_H_

#include <functional>
#include <string>

#include "absl/status/status.h"
#include "engine/core/cancel.h"
#include "engine/pipeline/engine.h"
#include "server/jobs/leases.h"
#include "server/store/blob_store.h"
#include "server/store/data_dir.h"
#include "server/store/installation_marker.h"
#include "server/store/job_store.h"

namespace litags {

struct WorkerOptions {
  std::string name = "worker";  // unique among all workers there ever were
  Resources has;                // what jobs may count on
  int threads = 0;  // most a job may use, and what one uses that does not say; 0: all cores
  DepthNetwork depth_network;         // for jobs that ask for depth by a network
  double colmap_step_seconds = 3600;  // wall clock of one COLMAP step; 0: no limit
  double poll_seconds = 0.25;         // between looks for cancellation and for shutdown
  double heartbeat_seconds = 2;       // between renewals of the lease
  double look_seconds = 2;            // between looks for work of which nobody told
  double progress_seconds = 1;        // between progress events within one stage
  double keep_seconds = 0;            // between two times that the engine's files are stored
  double grace_seconds = 5;  // for an engine, and at a shutdown a fetch, to obey its cancel token
  // Between looks of a worker that cannot begin jobs at whether it can again; doubles.
  double min_rest_seconds = 1, max_rest_seconds = 60;
  // Called when it does not: must not return. The store already says what becomes of the job.
  std::function<void()> give_up;
};

// What a worker works with; all must outlive it.
struct WorkerContext {
  JobStore* store;
  BlobStore* blobs;
  Leases* leases;
  Engine* engine;
  DataDir data;
  const InstallationMarker* marker;  // of `blobs`
};

// Runs a job to one of its ends: done, failed, cancelled, given back because `shutdown` was raised,
// or lost to another worker. Errors are those of the store, and those of a worker that could not
// begin the job and gave it back; what the engine says is in the job.
absl::Status RunJob(const Lease& lease, const WorkerContext& context, const WorkerOptions& options,
                    const CancelToken& shutdown);

}  // namespace litags

#endif  // LITAGS_SERVER_WORKER_JOB_RUNNER_H_
