// Runs `litags-bench train`, mostly where it cannot measure.
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "engine/core/image.h"
#include "engine/core/temp_dir_test_util.h"
#include "engine/io/depth_io.h"
#include "engine/io/file_util.h"
#include "engine/io/transforms_io.h"
#include "engine/tools/bench/run_bench_test_util.h"
#include "engine/tools/table/lom_test_util.h"
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

// What it has is scored only after the training.
class TrainCommandOnAScene : public testing::Test {
 protected:
  // Photos of 128x96 px, and test views without distortion: only those have a depth.
  void SetUp() override {
    WriteLomScene(scene_, 128, 96);
    WriteTrainingCameras(scene_, dir_ / "cameras");
    auto test = ReadCameras(scene_ + "/transforms_test.json", "test");
    ASSERT_TRUE(test.ok()) << test.status();
    std::fill(test->distortions.begin(), test->distortions.end(), Distortion());
    ASSERT_TRUE(WriteTransforms(scene_ + "/transforms_test.json", *test, "low").ok());
    test_ = test->views;
  }
  SubprocessResult Train(const std::vector<std::string>& more) {
    std::vector<std::string> arguments = {scene_,
                                          "-o",
                                          out_,
                                          "--cameras",
                                          dir_ / "cameras",
                                          "--iterations",
                                          "20",
                                          "--threads",
                                          "1",
                                          "--max-image-side",
                                          "64",
                                          "--json",
                                          dir_ / "figures.json"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return RunBench("train", arguments);
  }
  void ExpectRefused(const std::vector<std::string>& more, const std::string& reason) {
    const SubprocessResult result = Train(more);
    EXPECT_EQ(result.exit_code, 2) << result.tail;
    EXPECT_THAT(result.tail, testing::HasSubstr(reason));
    EXPECT_FALSE(std::filesystem::exists(out_)) << "it was trained";
  }

  TempDir dir_;
  const std::string scene_ = dir_ / "room", out_ = dir_ / "out";
  std::vector<View> test_;
};

TEST_F(TrainCommandOnAScene, DepthIsOfTheSizeThatIsTrained) {
  for (const View& view : test_) {
    const std::string path = scene_ + "/depth/" + Stem(view.name) + ".pfm";
    const auto large = ReadDepthMap(path, path);
    ASSERT_TRUE(large.ok()) << large.status();
    Planes map(1, 48, 64);
    for (int y = 0; y < map.height; ++y) {
      for (int x = 0; x < map.width; ++x) map.at(0, y, x) = large->at(0, 2 * y, 2 * x);
    }
    ASSERT_TRUE(WritePfm(path, map).ok());
  }
  const SubprocessResult result = Train({});
  ASSERT_EQ(result.exit_code, 0) << result.tail;
  const auto figures = nlohmann::json::parse(std::ifstream(dir_ / "figures.json"), nullptr, false);
  EXPECT_GT(figures.at("depth").at("within_10_percent").get<double>(), 0) << figures;
}

TEST_F(TrainCommandOnAScene, ATruthThatDoesNotFitIsRefusedBeforeItIsTrained) {
  ExpectRefused({}, "SIZE_MISMATCH");  // the maps are of the photos' size
  std::filesystem::remove_all(scene_ + "/depth");
  std::filesystem::create_directory(dir_ / "other");
  ExpectRefused({"--score-also", dir_ / "other"}, "NO_SUCH_PHOTO");
  for (const View& view : test_) std::filesystem::remove(scene_ + "/high/" + view.name);
  ExpectRefused({}, "NO_TRUTH");
}

// Rows were trained that had to fail.
TEST(TrainCommand, DepthThatNoOptionNamesIsRefused) {
  TempDir dir;
  for (const char* command : {"train", "table"}) {
    for (const std::string source : {"maps", "network"}) {
      const SubprocessResult result =
          RunBench(command, {dir.path(), "-o", dir / "out", "--depth-source", source});
      EXPECT_EQ(result.exit_code, 2);
      EXPECT_THAT(result.tail,
                  testing::HasSubstr("--depth-source takes auto, stereo or none here, not \"" +
                                     source + "\": only litags-train has --depth"))
          << command;
    }
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
