// litags-train twice on the same photos, from the photos on: the same bytes.
#include <gtest/gtest.h>

#include <filesystem>
#include <map>
#include <string>

#include "absl/strings/str_cat.h"
#include "engine/core/run_program_test_util.h"
#include "engine/core/subprocess.h"
#include "engine/core/temp_dir_test_util.h"
#include "engine/io/file_util.h"
#include "engine/sample/capture.h"

namespace litags {
namespace {

namespace fs = std::filesystem;

// Cameras, points and scene; by name.
std::map<std::string, std::string> Results(const std::string& out) {
  std::map<std::string, std::string> bytes;
  for (const char* name : {"scene.litags", "scene.ply", "cameras/cameras.bin", "cameras/images.bin",
                           "cameras/points3D.bin", "cameras/registration.json"}) {
    const auto read = ReadFile(absl::StrCat(out, "/", name), name, int64_t{1} << 30);
    EXPECT_TRUE(read.ok()) << read.status();
    if (read.ok()) bytes[name] = *read;
  }
  return bytes;
}

class SameBytes : public testing::TestWithParam<bool> {  // with known cameras
 protected:
  void SetUp() override {
    sample::CaptureOptions capture;
    capture.views = 8;
    capture.antialias = 2;
    const auto written = sample::WriteCapture(capture, scene_);
    ASSERT_TRUE(written.ok()) << written.status();
  }

  std::string Command(const std::string& out, int threads) const {
    return absl::StrCat(LITAGS_TRAIN, " '", scene_, GetParam() ? "' --light low" : "/low'", " -o '",
                        out, "' --iterations 4 --threads ", threads);
  }

  static void Shell(const std::string& script) {
    const SubprocessResult result = RunProgram("/bin/sh", {"-c", script});
    ASSERT_EQ(result.exit_code, 0) << result.tail;
  }

  static void ExpectSame(const std::string& a, const std::string& b) {
    const auto results = Results(a), others = Results(b);
    for (const auto& [name, bytes] : results) {
      EXPECT_TRUE(bytes == others.at(name)) << name << " of " << a << " and " << b;
    }
  }

  TempDir dir_;
  const std::string scene_ = dir_ / "room";
};

TEST_P(SameBytes, OfTheWholeJobForAnyNumberOfThreadsKilledOrNot) {
  const std::string once = dir_ / "once", killed = dir_ / "killed";
  ASSERT_NO_FATAL_FAILURE(Shell(Command(once, 1)));
  // Killed while cameras are looked for, and once they are found.
  for (const std::string& file :
       {killed + "/sfm/0/feature_extractor.log", killed + "/cameras/registration.json"}) {
    ASSERT_NO_FATAL_FAILURE(
        Shell(absl::StrCat(Command(killed, 2), " & pid=$!; while kill -0 $pid && [ ! -e '", file,
                           "' ]; do sleep 0.05; done; kill -9 $pid; wait $pid; test $? -eq 137")));
  }
  ASSERT_NO_FATAL_FAILURE(Shell(Command(killed, 2)));
  ExpectSame(once, killed);
}

INSTANTIATE_TEST_SUITE_P(Cameras, SameBytes, testing::Values(false, true),
                         [](const auto& info) { return info.param ? "Given" : "Found"; });

}  // namespace
}  // namespace litags
