// Runs `litags-bench train` where it cannot measure.
#include <filesystem>

#include "engine/io/test_util.h"
#include "engine/tools/bench/run_bench_test_util.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace litags {
namespace {

TEST(TrainCommand, ASceneWithoutTruthIsRefusedBeforeItIsTrained) {
  TempDir dir;
  std::filesystem::create_directory(dir / "low");
  const SubprocessResult result = RunBench("train", {dir.path(), "-o", dir / "out"});
  EXPECT_NE(result.exit_code, 0);
  EXPECT_THAT(result.tail, testing::HasSubstr("no folder high"));
}

}  // namespace
}  // namespace litags
