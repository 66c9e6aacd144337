#include "server/testing/fake_engine.h"
#include "server/worker/worker.h"

int main(int argc, char** argv) { return litags::WorkerMain(argc, argv, litags::MakeFakeEngine); }
