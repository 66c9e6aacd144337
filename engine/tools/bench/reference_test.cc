#include "engine/tools/bench/reference.h"

#include <cmath>
#include <filesystem>
#include <sstream>
#include <string>

#include "engine/core/simd_test_util.h"
#include "engine/core/temp_dir_test_util.h"
#include "engine/io/file_util.h"
#include "engine/io/npy_test_util.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace litags {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

TEST(Reference, EngineAgreesWithEveryCaseOnEveryTarget) {
  const fs::path folder = fs::path(LITAGS_SOURCE_DIR) / "../shared/reference";
  if (!fs::exists(folder)) GTEST_SKIP() << "no reference cases beside the source tree";
  ForEachTarget([&] {
    std::ostringstream table;
    const ReferenceSummary summary = RunReferenceCases(folder.string(), table);
    EXPECT_TRUE(summary.AllPassed()) << table.str();
    EXPECT_GE(summary.cases, 20);
  });
}

// Writes a "metrics" case: two flat images, whose PSNR and SSIM are known by hand.
class MetricsCase {
 public:
  static constexpr double kA = 100 / 255.0, kB = 110 / 255.0, kC1 = 1e-4;

  MetricsCase() {
    fs::create_directories(folder_ / "a_case");
    WriteImage("a", 100);
    WriteImage("b", 110);
  }

  std::string folder() const { return folder_.string(); }

  void WriteJson(const std::string& kind, double psnr_error) const {
    std::ostringstream json;
    json.precision(17);
    const double psnr = -20 * std::log10(kB - kA) + psnr_error;
    const double ssim = (2 * kA * kB + kC1) / (kA * kA + kB * kB + kC1);
    json << R"({"name": "flat", "kind": ")" << kind << R"(", "params": {}, "values": {"psnr_db": )"
         << psnr << R"(, "ssim": )" << ssim << R"(, "ssim_zero_padded": )" << ssim
         << R"(}, "tolerances": {"psnr_db_abs": 1e-4, "ssim_abs": 1.0},
              "arrays": {"a": {"role": "input"}, "b": {"role": "input"},
                         "map": {"role": "output"}}})";
    ASSERT_TRUE(WriteFileAtomically((folder_ / "a_case/case.json").string(), json.str()).ok());
  }

 private:
  void WriteImage(const std::string& name, uint8_t value) const {
    const std::string image = NumpyFile(1, NumpyHeader("|u1", "16, 16, 3"),
                                        std::string(16 * 16 * 3, static_cast<char>(value)));
    const auto path = (folder_ / "a_case" / (name + ".npy")).string();
    ASSERT_TRUE(WriteFileAtomically(path, image).ok());
  }

  const TempDir temporary_;
  const fs::path folder_ = temporary_.path();
};

TEST(Reference, RightNumbersPassAndArraysWithoutCounterpartAreNamed) {
  const MetricsCase flat;
  flat.WriteJson("metrics", 0);
  std::ostringstream table;
  const ReferenceSummary summary = RunReferenceCases(flat.folder(), table);
  EXPECT_TRUE(summary.AllPassed()) << table.str();
  EXPECT_EQ(summary.comparisons, 3);
  EXPECT_THAT(table.str(), HasSubstr("not covered by the engine's interface: map"));
}

TEST(Reference, NumbersPastToleranceFail) {
  const MetricsCase flat;
  flat.WriteJson("metrics", 2e-4);
  std::ostringstream table;
  const ReferenceSummary summary = RunReferenceCases(flat.folder(), table);
  EXPECT_FALSE(summary.AllPassed());
  EXPECT_EQ(summary.failed, 1);
  EXPECT_THAT(table.str(), HasSubstr("FAIL"));
}

TEST(Reference, UnknownKindsMissingArraysAndEmptyFoldersFail) {
  const MetricsCase flat;
  std::ostringstream table;
  EXPECT_FALSE(RunReferenceCases(flat.folder(), table).AllPassed());
  EXPECT_THAT(table.str(), HasSubstr("no case folders"));

  flat.WriteJson("weather", 0);
  EXPECT_EQ(RunReferenceCases(flat.folder(), table).unreadable, 1);
  EXPECT_THAT(table.str(), HasSubstr("unknown kind \"weather\""));

  flat.WriteJson("metrics", 0);
  fs::remove(fs::path(flat.folder()) / "a_case/b.npy");
  EXPECT_EQ(RunReferenceCases(flat.folder(), table).unreadable, 1);
}

}  // namespace
}  // namespace litags
