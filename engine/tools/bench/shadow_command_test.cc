// Runs `litags-bench shadows` on a made-up photo.
#include <filesystem>
#include <sstream>
#include <string>

#include "engine/core/image.h"
#include "engine/core/rng.h"
#include "engine/core/temp_dir_test_util.h"
#include "engine/io/image_io.h"
#include "engine/tools/bench/run_bench_test_util.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace litags {
namespace {

using ::testing::HasSubstr;

// PSNR and error of chroma of a step, 6 stops too dark.
struct Figures {
  double psnr = 0, chroma = 0;
};

Figures FiguresOf(const std::string& text, const std::string& step) {
  const size_t line = text.find("\n" + step + " ");
  EXPECT_NE(line, std::string::npos) << step;
  if (line == std::string::npos) return {};
  std::istringstream in(text.substr(line + 1 + step.size()));
  Figures figures;
  char slash = 0;
  in >> figures.psnr >> slash >> figures.chroma;
  return figures;
}

TEST(ShadowsCommand, EveryStepBringsADarkPhotoNearerToItsTruth) {
  TempDir dir;
  // Squares of a warm grey.
  ImageU8 photo(128, 96);
  const CounterRng rng(3, 1);
  for (int y = 0; y < photo.height; ++y) {
    for (int x = 0; x < photo.width; ++x) {
      const auto code = static_cast<int>(40 + rng.Below(y / 16 * 8 + x / 16, 120));
      const int rgb[3] = {code, code * 9 / 10, code * 7 / 10};
      for (int c = 0; c < 3; ++c) photo.pixel(x, y)[c] = static_cast<uint8_t>(rgb[c]);
    }
  }
  ASSERT_TRUE(WritePng(dir / "photo.png", photo).ok());
  std::filesystem::create_directory(dir / "out");
  const SubprocessResult result = RunBench("shadows", {dir.path(), "--pictures", dir / "out"});
  EXPECT_EQ(result.exit_code, 0) << result.tail;
  EXPECT_THAT(result.tail, HasSubstr("1 photos"));
  const Figures bytes = FiguresOf(result.tail, "8 bits"),
                fine = FiguresOf(result.tail, "floating point"),
                both = FiguresOf(result.tail, "+ both");
  EXPECT_GT(bytes.psnr, 10);
  EXPECT_GT(fine.psnr, bytes.psnr) << result.tail;
  EXPECT_GT(both.psnr, fine.psnr) << result.tail;
  EXPECT_LT(both.chroma, 0.7 * bytes.chroma) << result.tail;
  for (const char* picture : {"truth.png", "0.png", "4.png"}) {
    EXPECT_TRUE(ReadImage(dir / "out" + "/" + picture, picture).ok());
  }
}

TEST(ShadowsCommand, RefusesFoldersWithoutPhotos) {
  TempDir dir;
  EXPECT_EQ(RunBench("shadows", {dir.path()}).exit_code, 2);
}

}  // namespace
}  // namespace litags
