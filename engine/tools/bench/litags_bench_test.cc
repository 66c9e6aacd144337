// Runs commands of litags-bench that need no files.
#include "engine/tools/bench/run_bench_test_util.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace litags {
namespace {

using ::testing::ContainsRegex;
using ::testing::HasSubstr;
using ::testing::Not;

#ifdef __x86_64__
TEST(MachineCommand, UsesTheInstructionSetItIsTold) {
  const SubprocessResult result = RunBench("--instruction-set", {"SSE4", "machine"});
  EXPECT_EQ(result.exit_code, 0) << result.tail;
  EXPECT_THAT(result.tail, HasSubstr("instruction set SSE4"));
}
#endif

TEST(KernelsCommand, EveryPartHasItsWorkHoweverFewGaussiansThereAre) {
  const SubprocessResult result = RunBench(
      "kernels", {"--gaussians", "480", "--size", "64x48", "--repetitions", "3", "--threads", "1"});
  EXPECT_EQ(result.exit_code, 0) << result.tail;
  EXPECT_THAT(result.tail, Not(ContainsRegex("[0-9][0-9][0-9][0-9][0-9] % of it")));
}

TEST(KernelsCommand, RefusesAValueInTheWordsOfEveryProgram) {
  const SubprocessResult result = RunBench("kernels", {"--pdm-hidden", "1.5"});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.tail,
              HasSubstr("--pdm-hidden takes a whole number from 0 to 64, not \"1.5\""));
}

TEST(TableCommand, SaysTheReasonOfWrongInput) {
  const SubprocessResult result = RunBench("table", {"nowhere", "-o", "table"});
  EXPECT_EQ(result.exit_code, 2) << result.tail;
  EXPECT_THAT(result.tail, HasSubstr("reason NO_SUCH_SCENE, field nowhere"));
}

TEST(ThreadsCommand, PrintsTimesForUpTo64ThreadsAndEachLoop) {
  const SubprocessResult result =
      RunBench("threads", {"--gaussians", "480", "--size", "64x48", "--repetitions", "2"});
  EXPECT_EQ(result.exit_code, 0) << result.tail;
  EXPECT_THAT(result.tail, ContainsRegex("\n +64 "));
  EXPECT_THAT(result.tail, HasSubstr(" renderer.cc:"));
}

}  // namespace
}  // namespace litags
