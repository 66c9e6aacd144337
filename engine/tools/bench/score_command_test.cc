// Runs `litags-bench score`.
#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "engine/core/image.h"
#include "engine/core/temp_dir_test_util.h"
#include "engine/io/file_util.h"
#include "engine/io/picture_io.h"
#include "engine/onnx/onnx_writer.h"
#include "engine/tools/bench/run_bench_test_util.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace litags {
namespace {

// Half black, half white is code 188: the truth is averaged in linear light, as training shrinks.
TEST(ScoreCommand, LargerTruthIsAveragedDownAndLpipsIsOfAGivenNetwork) {
  TempDir dir;
  ImageU8 checkers(128, 96), gray(64, 48);
  for (int y = 0; y < 96; ++y) {
    for (int x = 0; x < 128; ++x) std::fill_n(checkers.pixel(x, y), 3, (x + y) % 2 == 0 ? 0 : 255);
  }
  std::fill(gray.data.begin(), gray.data.end(), 188);
  for (const char* folder : {"truth", "renders"}) std::filesystem::create_directory(dir / folder);
  ASSERT_TRUE(WritePng(dir / "truth/a.png", checkers).ok());
  ASSERT_TRUE(WritePng(dir / "renders/a.png", gray).ok());
  ASSERT_TRUE(WriteFileAtomically(dir / "lpips.onnx", SquaredDifferenceModel(48, 64)).ok());
  const SubprocessResult result = RunBench("score", {dir / "renders", dir / "truth", "--lpips",
                                                     dir / "lpips.onnx", "--json", dir / "j"});
  EXPECT_EQ(result.exit_code, 0) << result.tail;
  EXPECT_THAT(result.tail, testing::HasSubstr("PSNR inf dB"));
  const auto json = nlohmann::json::parse(ReadFile(dir / "j", "", 1 << 20).value());
  EXPECT_EQ(json["lpips"], 0);
}

TEST(ScoreCommand, ATruthOfAnotherShapeIsRefused) {
  TempDir dir;
  for (const char* folder : {"truth", "renders"}) std::filesystem::create_directory(dir / folder);
  ASSERT_TRUE(WritePng(dir / "truth/a.png", ImageU8(48, 64)).ok());
  ASSERT_TRUE(WritePng(dir / "renders/a.png", ImageU8(64, 48)).ok());
  const SubprocessResult result = RunBench("score", {dir / "renders", dir / "truth"});
  EXPECT_EQ(result.exit_code, 2) << result.tail;
  EXPECT_THAT(result.tail, testing::HasSubstr("is 48x64, what it is compared with 64x48"));
}

TEST(ScoreCommand, OnlyPicturesCountAndEachStemStandsOnce) {
  TempDir dir;
  const ImageU8 gray(64, 48);
  for (const char* folder : {"truth", "renders"}) {
    std::filesystem::create_directory(dir / folder);
    ASSERT_TRUE(WritePng(dir / (std::string(folder) + "/a.png"), gray).ok());
    // Whichever order the folder has them in, one of these comes after the picture.
    for (const char* other : {"/a.json", "/a.txt", "/a.zip"}) {
      ASSERT_TRUE(WriteFileAtomically(dir / (std::string(folder) + other), "{}").ok());
    }
  }
  SubprocessResult result = RunBench("score", {dir / "renders", dir / "truth"});
  EXPECT_EQ(result.exit_code, 0) << result.tail;
  EXPECT_THAT(result.tail, testing::HasSubstr("a.png  PSNR inf dB"));
  ASSERT_TRUE(WritePng(dir / "renders/a.PNG", gray).ok());
  result = RunBench("score", {dir / "renders", dir / "truth"});
  EXPECT_EQ(result.exit_code, 2) << result.tail;
  EXPECT_THAT(result.tail, testing::HasSubstr("holds a.PNG and a.png"));
}

}  // namespace
}  // namespace litags
