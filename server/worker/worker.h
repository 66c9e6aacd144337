#ifndef LITAGS_SERVER_WORKER_WORKER_H_
#define LITAGS_SERVER_WORKER_WORKER_H_

#include <memory>

#include "engine/core/cancel.h"
#include "engine/pipeline/engine.h"
#include "server/worker/job_runner.h"

namespace litags {

// Takes jobs one after the other until `shutdown` is raised. Errors of the store are logged and
// waited out; a worker that could not begin a job takes none until CheckWorkerAfter() finds it
// well.
void RunWorker(const WorkerContext& context, const WorkerOptions& options,
               const CancelToken& shutdown);

// Makes the engine once the command line is known.
using EngineFactory = std::unique_ptr<Engine> (*)(std::string colmap);

// The program litags-worker: parses the command line, works until SIGTERM or SIGINT, and returns
// the exit code.
int WorkerMain(int argc, char** argv, EngineFactory make_engine);

}  // namespace litags

#endif  // LITAGS_SERVER_WORKER_WORKER_H_
