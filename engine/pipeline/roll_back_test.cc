// A job meets numbers that are not finite: it goes around them and says so, or says why it cannot.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <string>
#include <vector>

#include "engine/core/error_test_util.h"
#include "engine/io/depth_io.h"
#include "engine/pipeline/reconstruct_test_util.h"

namespace litags {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;

// Photos with uploaded depth maps, some of them in a unit so large that depths are the smallest
// numbers of a float: they are accepted, but the gradient of their correlation is beyond a float.
class HostileDepth {
 public:
  explicit HostileDepth(const std::vector<int>& spoilt) {
    const std::filesystem::path dir = photos_.Photo("../depth");
    std::filesystem::create_directory(dir);
    constexpr float kLeast = std::numeric_limits<float>::denorm_min();
    for (int i = 0; i < kPhotos; ++i) {
      const bool bad = std::find(spoilt.begin(), spoilt.end(), i) != spoilt.end();
      Planes map(1, kHeight, kWidth);
      for (size_t k = 0; k < map.data.size(); ++k) {
        map.data[k] = bad ? (k % 8 == 0 ? 3 : 1) * kLeast : 3 + 0.01f * (k % 97);
      }
      EXPECT_TRUE(WritePfm(dir / ("photo" + std::to_string(i) + ".pfm"), map).ok());
    }
  }

  ReconstructInput Input(const std::string& run) const {
    ReconstructInput input = photos_.Input(run);
    input.depth_dir = photos_.Photo("../depth");
    return input;
  }

 private:
  Photographs photos_;
};

ReconstructOptions GivenMaps() {
  ReconstructOptions options = SmallOptions();
  options.depth_source = DepthOrigin::kMaps;
  return options;
}

void ExpectFiniteScene(const std::string& path) {
  const auto scene = MakeEngine()->LoadScene(path);
  ASSERT_TRUE(scene.ok()) << scene.status();
  RenderRequest request;
  request.camera = (*scene)->views()[0].camera;
  request.channel = Channel::kIllumination;  // not clamped
  const auto picture = (*scene)->Render(request);
  ASSERT_TRUE(picture.ok()) << picture.status();
  for (const float v : picture->data) ASSERT_TRUE(std::isfinite(v));
}

TEST(RollBack, AJobGoesAroundAPhotoAndSaysSo) {
  const HostileDepth capture({1});
  Recorder recorder;
  const auto report = MakeEngine(kNoColmap)->Reconstruct(capture.Input("work"), GivenMaps(),
                                                         CancelToken(), &recorder);
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_EQ(report->iterations, kIterations);
  EXPECT_THAT(report->notes, Contains(HasSubstr("rolled back 2 times")));
  EXPECT_THAT(report->notes,
              Contains(AllOf(HasSubstr("the gradient of the rendered depth"),
                             HasSubstr("photo1.png"), HasSubstr("turn was skipped"))));
  // Users who watch are told when it happens.
  const auto told =
      std::count_if(recorder.reports.begin(), recorder.reports.end(), [](const Progress& p) {
        return p.message.find("is not finite") != std::string::npos &&
               p.message.find("going on from iteration") != std::string::npos;
      });
  EXPECT_EQ(told, 2);
  ExpectFiniteScene(report->scene_path);
}

// Kills and cancels, before and after the roll-backs, change nothing.
TEST(RollBack, AnInterruptedJobEndsWithTheSameBytes) {
  const HostileDepth capture({1});
  const ReconstructInput whole = capture.Input("whole");
  ASSERT_TRUE(Reconstruct(whole, GivenMaps()).ok());
  for (const int stop : {10, 20, 30}) {
    const ReconstructInput parts = capture.Input("parts" + std::to_string(stop));
    CancelToken cancel;
    Recorder recorder;
    recorder.on_progress = [&](const Progress& p) {
      if (p.iteration >= stop) cancel.Cancel();
    };
    EXPECT_EQ(
        MakeEngine(kNoColmap)->Reconstruct(parts, GivenMaps(), cancel, &recorder).status().code(),
        absl::StatusCode::kCancelled);
    const auto report = Reconstruct(parts, GivenMaps());
    ASSERT_TRUE(report.ok()) << report.status();
    EXPECT_THAT(report->notes, Contains(HasSubstr("rolled back 2 times")));
    EXPECT_TRUE(SceneBytes(parts) == SceneBytes(whole)) << "cancelled at " << stop;
  }
}

TEST(RollBack, AJobWhosePhotosAreAllSpoiltSaysWhy) {
  const HostileDepth capture({0, 1, 2, 3, 4, 5, 6, 7});
  const absl::Status status = Reconstruct(capture.Input("work"), GivenMaps()).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kInternal);
  EXPECT_EQ(Reason(status), "NOT_FINITE");
  EXPECT_THAT(std::string(status.message()), HasSubstr("the gradient of the rendered depth"));
  EXPECT_THAT(std::string(status.message()), HasSubstr("leave out that photo or its depth map"));
}

}  // namespace
}  // namespace litags
