// Runs commands of litags-bench that need no files.
#include "engine/core/run_program_test_util.h"
#include "engine/core/subprocess.h"
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

TEST(Bench, InputThatIsWrongIsToldBeforeAnythingIsMeasured) {
  const struct {
    std::string command;
    std::vector<std::string> arguments;
    std::string said;
  } wrong[] = {
      {"kernels", {"--size", "64x48abc"}, "--size 64x48abc: give WIDTHxHEIGHT"},
      {"kernels", {"--threads", "-1"}, "--threads takes a whole number from 0 to 1024, not"},
      {"machine", {"--json", "/no/such/folder/x.json"}, "--json takes a file in a folder that is"},
      {"machine", {"--json", "/tmp"}, "--json takes a file in a folder that is there, not"},
      {"reference", {"nonexist"}, "reason NO_SUCH_FOLDER, field DIR"},
  };
  for (const auto& [command, arguments, said] : wrong) {
    const SubprocessResult result = RunBench(command, arguments);
    EXPECT_EQ(result.exit_code, 2) << result.tail;
    EXPECT_THAT(result.tail, HasSubstr(said));
    EXPECT_THAT(result.tail, Not(HasSubstr("instruction set"))) << "it was measured";
  }
}

TEST(Bench, OutputThatIsLostIsAnError) {
  const SubprocessResult result = RunIntoFullDevice(LITAGS_BENCH, {"machine"});
  EXPECT_EQ(result.exit_code, 1) << result.tail;
  EXPECT_THAT(result.tail, HasSubstr("not all of the output could be written"));
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
