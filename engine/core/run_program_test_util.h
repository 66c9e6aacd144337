#ifndef LITAGS_ENGINE_CORE_RUN_PROGRAM_TEST_UTIL_H_
#define LITAGS_ENGINE_CORE_RUN_PROGRAM_TEST_UTIL_H_

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "engine/core/cancel.h"
#include "engine/core/subprocess.h"

namespace litags {

// Runs `program` with `arguments`; the last 1,000 lines that it prints are in `tail`. Exit code -1
// if it cannot be run.
inline SubprocessResult RunProgram(const std::string& program,
                                   const std::vector<std::string>& arguments) {
  SubprocessOptions child;
  child.args = {program};
  child.args.insert(child.args.end(), arguments.begin(), arguments.end());
  child.tail_lines = 1000;
  const auto result = RunSubprocess(child, CancelToken());
  EXPECT_TRUE(result.ok()) << result.status();
  SubprocessResult none;
  none.exit_code = -1;
  return result.value_or(none);
}

// The same with standard output on a disk that is full; what it prints to standard error is in
// `tail`.
inline SubprocessResult RunIntoFullDevice(const std::string& program,
                                          const std::vector<std::string>& arguments) {
  std::vector<std::string> shell = {"-c", "exec \"$0\" \"$@\" >/dev/full", program};
  shell.insert(shell.end(), arguments.begin(), arguments.end());
  return RunProgram("/bin/sh", shell);
}

}  // namespace litags

#endif  // LITAGS_ENGINE_CORE_RUN_PROGRAM_TEST_UTIL_H_
