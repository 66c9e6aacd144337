#include "engine/pipeline/engine.h"
#include "server/worker/worker.h"

int main(int argc, char** argv) { return litags::WorkerMain(argc, argv, litags::MakeEngine); }
