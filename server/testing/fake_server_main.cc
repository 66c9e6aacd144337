#include "server/main/server_main.h"
#include "server/testing/fake_engine.h"

int main(int argc, char** argv) {
  return litags::ServerMain(argc, argv, "litags-fake-worker", litags::MakeFakeEngine);
}
