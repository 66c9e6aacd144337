// Runs `litags-bench train` where it cannot measure.
#include <filesystem>
#include <string>
#include <vector>

#include "engine/core/temp_dir_test_util.h"
#include "engine/io/file_util.h"
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

TEST(TrainCommand, ASceneWithoutTestViewsIsRefusedBeforeItIsTrained) {
  TempDir dir;
  for (const char* folder : {"high", "low"}) std::filesystem::create_directory(dir / folder);
  const SubprocessResult result = RunBench("train", {dir.path(), "-o", dir / "out"});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.tail, testing::HasSubstr("has no transforms_test.json"));
  EXPECT_FALSE(std::filesystem::exists(dir / "out"));
}

TEST(TrainCommand, AMistakeLeavesTheSceneOfAnEarlierRun) {
  TempDir dir;
  for (const char* folder : {"high", "low", "out"}) std::filesystem::create_directory(dir / folder);
  const std::string scene = dir / "out/scene.litags";
  ASSERT_TRUE(WriteFileAtomically(scene, "x").ok());
  ASSERT_TRUE(WriteFileAtomically(dir / "transforms_test.json", "{").ok());
  const std::vector<std::vector<std::string>> mistakes = {{"--light", "lwo"},
                                                          {"--cameras", dir / "none.json"}};
  for (const std::vector<std::string>& mistake : mistakes) {
    std::vector<std::string> arguments = {dir.path(), "-o", dir / "out"};
    arguments.insert(arguments.end(), mistake.begin(), mistake.end());
    EXPECT_NE(RunBench("train", arguments).exit_code, 0);
    EXPECT_TRUE(std::filesystem::exists(scene)) << mistake[0];
  }
}

// Files of the root folder were removed.
TEST(TrainCommand, AnEmptyOutputFolderIsRefused) {
  TempDir dir;
  for (const char* command : {"train", "table"}) {
    const SubprocessResult result = RunBench(command, {dir.path(), "-o", ""});
    EXPECT_EQ(result.exit_code, 2);
    EXPECT_THAT(result.tail, testing::HasSubstr("--output takes the name of a folder")) << command;
  }
}

}  // namespace
}  // namespace litags
