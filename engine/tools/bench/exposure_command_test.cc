// Runs `litags-bench exposure` on made-up photos.
#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <sstream>
#include <string>
#include <vector>

#include "engine/core/color.h"
#include "engine/core/image.h"
#include "engine/core/rng.h"
#include "engine/core/temp_dir_test_util.h"
#include "engine/io/picture_io.h"
#include "engine/target/exposure_rule.h"
#include "engine/tools/bench/run_bench_test_util.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace litags {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

// Squares of random codes about `middle`, and a white corner.
ImageU8 MakePhoto(uint64_t seed, int middle) {
  ImageU8 photo(96, 64);
  const CounterRng rng(5, seed);
  for (int y = 0; y < photo.height; ++y) {
    for (int x = 0; x < photo.width; ++x) {
      const int square = middle - 60 + static_cast<int>(rng.Below(y / 8 * 12 + x / 8, 120));
      const int code = x < 16 && y < 16 ? 255 : square;
      std::fill_n(photo.pixel(x, y), 3, static_cast<uint8_t>(code));
    }
  }
  return photo;
}

SubprocessResult RunExposure(const std::vector<std::string>& arguments) {
  return RunBench("exposure", arguments);
}

// The last four numbers of the line of a kind.
std::vector<double> ErrorsOfRule(const std::string& text, const std::string& kind) {
  const size_t line = text.find("\n" + kind + " ");
  EXPECT_NE(line, std::string::npos) << kind;
  if (line == std::string::npos) return {};
  const std::string row = text.substr(line + 1, text.find('\n', line + 1) - line - 1);
  std::istringstream in(row.substr(row.rfind('|') + 1));
  std::vector<double> numbers;
  for (double number = 0; in >> number;) numbers.push_back(number);
  return numbers;
}

TEST(ExposureCommand, PrintsErrorsOfEveryKindAndConstants) {
  TempDir dir;
  for (int i = 0; i < 6; ++i) {
    const std::string name = dir / ("photo" + std::to_string(i) + ".png");
    ASSERT_TRUE(WritePng(name, MakePhoto(i, 110 + 5 * i)).ok());
  }
  const SubprocessResult plain = RunExposure({dir.path()});
  EXPECT_EQ(plain.exit_code, 0) << plain.tail;
  EXPECT_THAT(plain.tail, HasSubstr("6 photos"));
  EXPECT_THAT(plain.tail, Not(HasSubstr("weights")));
  EXPECT_THAT(plain.tail, Not(HasSubstr("nan")));
  for (const char* kind :
       {"plain", "own", "lamps", "windows", "sky", "lamps and windows", "crops", "dark by 6",
        "dark by 7.5", "dark by 9", "png, dark by 9", "torch, noise 1", "over by 1", "over by 3"}) {
    const std::vector<double> errors = ErrorsOfRule(plain.tail, kind);
    ASSERT_EQ(errors.size(), 4u) << kind;
    EXPECT_LT(errors[2], 3) << kind;  // mean of sizes
  }
  // Photos that are alike: their exposure is found again.
  EXPECT_LT(ErrorsOfRule(plain.tail, "plain")[2], 0.5);

  const SubprocessResult fit = RunExposure({dir.path(), "--fit"});
  EXPECT_EQ(fit.exit_code, 0) << fit.tail;
  const size_t weights = fit.tail.find("\nweights ");
  ASSERT_NE(weights, std::string::npos) << fit.tail;
  const size_t end = fit.tail.find('\n', weights + 1);
  EXPECT_EQ(std::count(&fit.tail[weights], &fit.tail[end], ','), ExposureRule::kBands);
  EXPECT_THAT(fit.tail.substr(end), HasSubstr("lightness -"));
}

TEST(ExposureCommand, ErrorsOfAScenesLightsDifferByTheirGains) {
  TempDir dir;
  const auto write = [&](const char* light, const char* name, double gain) {
    ImageU8 photo = MakePhoto(3, 110);
    for (uint8_t& code : photo.data) {
      const double unclipped = std::min<int>(code, 235) / 255.0;
      code = static_cast<uint8_t>(255 * SrgbFromLinear(gain * LinearFromSrgb(unclipped)) + 0.5);
    }
    std::filesystem::create_directories(dir / light);
    ASSERT_TRUE(WritePng(dir / light + "/" + name, photo).ok());
  };
  const auto error = [&](const std::string& light) {
    const SubprocessResult result = RunExposure({"--scene", dir.path(), "--light", light});
    EXPECT_EQ(result.exit_code, 0) << result.tail;
    return std::atof(result.tail.substr(result.tail.rfind(": ") + 2).c_str());
  };
  write("high", "a.png", 1);
  write("high", "b.png", 0.5);
  write("one", "a.png", 1);
  write("half", "b.png", 0.5);
  write("quarter", "a.PNG", 0.25);
  EXPECT_NEAR(error("one"), error("quarter"), 0.05) << "darker, and brightened by as much more";
  EXPECT_NEAR(error("half"), error("one") + 1, 0.05) << "the truth is darker";
  write("none", "c.png", 1);
  EXPECT_THAT(RunExposure({"--scene", dir.path(), "--light", "none"}).tail,
              HasSubstr("has no photo of"));
  EXPECT_NE(RunExposure({}).exit_code, 0);
}

TEST(ExposureCommand, RefusesFoldersWithoutPhotos) {
  TempDir dir;
  const SubprocessResult empty = RunExposure({dir.path()});
  EXPECT_EQ(empty.exit_code, 2);
  EXPECT_THAT(empty.tail, HasSubstr("holds no photo"));
  EXPECT_NE(RunExposure({dir / "none"}).exit_code, 0);
}

}  // namespace
}  // namespace litags
