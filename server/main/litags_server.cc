#include "engine/pipeline/engine.h"
#include "proto/arguments/arguments.h"
#include "server/main/server_main.h"

int main(int argc, char** argv) {
  return litags::RunProgram("litags-server", [&] {
    return litags::ServerMain(argc, argv, "litags-worker", litags::MakeEngine);
  });
}
