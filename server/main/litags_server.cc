#include "engine/pipeline/engine.h"
#include "server/main/server_main.h"

int main(int argc, char** argv) {
  return litags::ServerMain(argc, argv, "litags-worker", litags::MakeEngine);
}
