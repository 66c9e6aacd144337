#include "engine/pipeline/engine.h"
#include "server/api/server_main.h"

int main(int argc, char** argv) {
  return litags::ServerMain(argc, argv, "litags-worker", litags::MakeEngine);
}
