#ifndef LITAGS_ENGINE_TOOLS_BENCH_RUN_BENCH_TEST_UTIL_H_
#define LITAGS_ENGINE_TOOLS_BENCH_RUN_BENCH_TEST_UTIL_H_

#include <string>
#include <vector>

#include "engine/core/subprocess.h"
#include "gtest/gtest.h"

namespace litags {

// Runs `litags-bench COMMAND ARGUMENTS`; what it prints is in `tail`.
inline SubprocessResult RunBench(const std::string& command,
                                 const std::vector<std::string>& arguments) {
  SubprocessOptions child;
  child.args = {LITAGS_BENCH, command};
  child.args.insert(child.args.end(), arguments.begin(), arguments.end());
  child.tail_lines = 100;
  const auto result = RunSubprocess(child, CancelToken());
  EXPECT_TRUE(result.ok()) << result.status();
  return result.value_or(SubprocessResult());
}

}  // namespace litags

#endif  // LITAGS_ENGINE_TOOLS_BENCH_RUN_BENCH_TEST_UTIL_H_
