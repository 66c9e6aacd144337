#include "engine/pipeline/engine.h"
#include "engine/video/frame_process.h"
#include "proto/arguments/arguments.h"
#include "server/worker/worker.h"

int main(int argc, char** argv) {
  if (const auto exit = litags::MaybePickFrames(argc, argv)) return *exit;
  return litags::RunProgram("litags-worker",
                            [&] { return litags::WorkerMain(argc, argv, litags::MakeEngine); });
}
