#ifndef LITAGS_SERVER_MAIN_SERVER_MAIN_H_
#define LITAGS_SERVER_MAIN_SERVER_MAIN_H_

#include "server/worker/worker.h"

namespace litags {

// The program litags-server: parses the command line, serves until SIGTERM or SIGINT, and returns
// the exit code. Workers are the program `worker_program` beside this one.
int ServerMain(int argc, char** argv, const char* worker_program, EngineFactory make_engine);

}  // namespace litags

#endif  // LITAGS_SERVER_MAIN_SERVER_MAIN_H_
