// Runs `litags-bench exposure` on made-up photos.
#include <algorithm>
#include <sstream>
#include <string>
#include <vector>

#include "engine/core/rng.h"
#include "engine/core/subprocess.h"
#include "engine/io/image_io.h"
#include "engine/io/test_util.h"
#include "engine/target/exposure_rule.h"
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
  SubprocessOptions child;
  child.args = {LITAGS_BENCH, "exposure"};
  child.args.insert(child.args.end(), arguments.begin(), arguments.end());
  child.tail_lines = 100;
  const auto result = RunSubprocess(child, CancelToken());
  EXPECT_TRUE(result.ok()) << result.status();
  return result.value_or(SubprocessResult());
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
  for (const char* kind : {"plain", "own", "lamps", "windows", "sky", "lamps and windows", "crops",
                           "dark by 6", "dark by 7.5", "dark by 9", "over by 1", "over by 3"}) {
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

TEST(ExposureCommand, RefusesFoldersWithoutPhotos) {
  TempDir dir;
  const SubprocessResult empty = RunExposure({dir.path()});
  EXPECT_EQ(empty.exit_code, 1);
  EXPECT_THAT(empty.tail, HasSubstr("holds no photo"));
  EXPECT_NE(RunExposure({dir / "none"}).exit_code, 0);
}

}  // namespace
}  // namespace litags
