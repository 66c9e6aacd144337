#ifndef LITAGS_ENGINE_TOOLS_BENCH_RUN_BENCH_TEST_UTIL_H_
#define LITAGS_ENGINE_TOOLS_BENCH_RUN_BENCH_TEST_UTIL_H_

#include <string>
#include <vector>

#include "engine/core/run_program_test_util.h"
#include "engine/core/subprocess.h"

namespace litags {

// Runs `litags-bench COMMAND ARGUMENTS`; what it prints is in `tail`.
inline SubprocessResult RunBench(const std::string& command,
                                 const std::vector<std::string>& arguments) {
  std::vector<std::string> all = {command};
  all.insert(all.end(), arguments.begin(), arguments.end());
  return RunProgram(LITAGS_BENCH, all);
}

}  // namespace litags

#endif  // LITAGS_ENGINE_TOOLS_BENCH_RUN_BENCH_TEST_UTIL_H_
