#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <thread>
#include <utility>
#include <vector>

#include "engine/core/camera.h"
#include "engine/core/cancel.h"
#include "engine/core/counted.h"
#include "engine/core/error.h"
#include "engine/core/error_test_util.h"
#include "engine/core/image.h"
#include "engine/core/json_text.h"
#include "engine/core/parallel.h"
#include "engine/core/rng.h"
#include "engine/core/shrunk_size.h"
#include "engine/core/splats.h"
#include "engine/core/utf8.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace litags {
namespace {

TEST(Counted, OneHasNoS) {
  EXPECT_EQ(Counted(1, "photo"), "1 photo");
  EXPECT_EQ(Counted(0, "photo"), "0 photos");
  EXPECT_EQ(Counted(size_t{2}, "photo"), "2 photos");
}

TEST(Error, CarriesReasonAndField) {
  absl::Status status =
      InvalidInput("IMAGE_TRUNCATED", "images[a.jpg]", "cut short; send it again");
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  ASSERT_TRUE(GetErrorDetail(status).has_value());
  EXPECT_EQ(GetErrorDetail(status)->reason, "IMAGE_TRUNCATED");
  EXPECT_EQ(GetErrorDetail(status)->field, "images[a.jpg]");
  EXPECT_FALSE(GetErrorDetail(absl::InternalError("x")).has_value());
}

TEST(JsonText, TakesNamesThatAreNoUtf8AndIsReadBack) {
  const nlohmann::json json = {{"name", "caf\xe9.jpg"}, {"sides", {3, 4}}};
  EXPECT_EQ(JsonText(json), "{\"name\":\"caf\xef\xbf\xbd.jpg\",\"sides\":[3,4]}");
  EXPECT_EQ(ParseJson(JsonText(json, 2))["sides"], json["sides"]);
  const nlohmann::ordered_json ordered = {{"z", 1}, {"a", "\xff"}};
  EXPECT_EQ(JsonText(ordered), "{\"z\":1,\"a\":\"\xef\xbf\xbd\"}");
  EXPECT_TRUE(ParseJson("{\"name\": ").is_discarded());
}

TEST(CancelToken, CopiesShareTheFlag) {
  CancelToken a;
  CancelToken b = a;
  EXPECT_TRUE(b.Check().ok());
  a.Cancel();
  EXPECT_EQ(b.Check().code(), absl::StatusCode::kCancelled);
}

Camera TestCamera() {
  Camera camera;
  camera.width = 64;
  camera.height = 48;
  camera.fx = camera.fy = 50;
  camera.cx = 32;
  camera.cy = 24;
  return camera;
}

TEST(CancelToken, EndsASleep) {
  CancelToken token;
  std::thread other([token]() mutable { token.Cancel(); });
  token.SleepFor(3600);
  other.join();
  EXPECT_TRUE(token.IsCancelled());
}

TEST(Camera, LookAtPutsTheTargetOnTheAxisAndUpUp) {
  Camera camera = TestCamera();
  ASSERT_TRUE(camera.LookAt({1, 2, 3}, {4, 2, 7}, {0, 0, 1}).ok());
  ASSERT_TRUE(camera.Validate("camera").ok());
  const auto target = camera.CamFromWorld({4, 2, 7});
  EXPECT_NEAR(target[0], 0, 1e-12);
  EXPECT_NEAR(target[1], 0, 1e-12);
  EXPECT_NEAR(target[2], 5, 1e-12);
  EXPECT_LT(camera.CamFromWorld({4, 2, 8})[1], 0) << "world up must point up (negative y)";
  const auto center = camera.Center();
  EXPECT_NEAR(center[0], 1, 1e-12);
  EXPECT_NEAR(center[1], 2, 1e-12);
  EXPECT_NEAR(center[2], 3, 1e-12);
}

TEST(Camera, LookAtNeedsADirectionAndAnUpBesideIt) {
  Camera camera = TestCamera();
  EXPECT_EQ(Reason(camera.LookAt({1, 2, 3}, {1, 2, 3}, {0, 0, 1})), "LOOK_AT_DEGENERATE");
  EXPECT_EQ(Reason(camera.LookAt({1, 2, 3}, {1, 2, 5}, {0, 0, 1})), "LOOK_AT_DEGENERATE");
}

TEST(Camera, UnprojectIsWhatProjectUndoes) {
  Camera camera{.width = 64, .height = 48, .fx = 50, .fy = 60, .cx = 31, .cy = 25};
  EXPECT_THAT(camera.Project({0, 0, 3}), testing::ElementsAre(31, 25));
  const auto point = camera.Unproject(10.5, 40.5, 2);
  EXPECT_EQ(point[2], 2);
  EXPECT_THAT(camera.Project(point), testing::ElementsAre(testing::DoubleNear(10.5, 1e-12),
                                                          testing::DoubleNear(40.5, 1e-12)));
}

TEST(Camera, MovedSeesAMovedWorldAlike) {
  Camera camera;
  ASSERT_TRUE(camera.LookAt({1, 2, -3}, {0.5, 0, 4}, {0, -1, 0.2}).ok());
  const Camera moved = camera.Moved({10, -20, 30});
  const std::array<double, 3> point = {0.3, 0.4, 5}, moved_point = {10.3, -19.6, 35};
  for (int k = 0; k < 3; ++k) {
    EXPECT_NEAR(moved.Center()[k], camera.Center()[k] + (k == 0 ? 10 : k == 1 ? -20 : 30), 1e-12);
    EXPECT_NEAR(moved.CamFromWorld(moved_point)[k], camera.CamFromWorld(point)[k], 1e-12);
  }
  EXPECT_EQ(moved.R, camera.R);
}

TEST(Camera, ValidateNamesTheField) {
  Camera camera = TestCamera();
  camera.t[1] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(GetErrorDetail(camera.Validate("pose"))->field, "pose");
  EXPECT_EQ(GetErrorDetail(camera.Validate("pose"))->reason, "NOT_FINITE");
  camera = TestCamera();
  camera.R[0] = -1;  // left-handed
  EXPECT_EQ(GetErrorDetail(camera.Validate("pose"))->reason, "NOT_A_ROTATION");
  camera = TestCamera();
  camera.fx = 0;
  EXPECT_EQ(GetErrorDetail(camera.Validate("k"))->reason, "BAD_FOCAL_LENGTH");
  camera = TestCamera();
  EXPECT_EQ(GetErrorDetail(camera.Validate("k", 100))->reason, "IMAGE_TOO_LARGE");
  camera.height = 8;
  camera.width = kMaxImageSide;
  EXPECT_TRUE(camera.Validate("k").ok());
  camera.width += 1;
  EXPECT_EQ(GetErrorDetail(camera.Validate("k"))->reason, "IMAGE_TOO_LARGE");
}

TEST(ParallelFor, RunsEveryTaskOnceForAnyThreadCount) {
  for (int threads : {1, 2, 5}) {
    std::vector<std::atomic<int>> hits(1000);
    ParallelFor(threads, hits.size(), [&](size_t i, int thread) {
      EXPECT_LT(thread, threads);
      ++hits[i];
    });
    for (const auto& h : hits) EXPECT_EQ(h.load(), 1);
  }
}

TEST(ParallelFor, ThreadsTakeTheirShareFromTheFrontAndOthersFromTheBack) {
  constexpr size_t kTasks = 1000;
  std::vector<size_t> own[2], others[2];
  ParallelFor(2, kTasks, [&](size_t task, int thread) {
    (task * 2 / kTasks == static_cast<size_t>(thread) ? own : others)[thread].push_back(task);
  });
  for (int thread = 0; thread < 2; ++thread) {
    EXPECT_TRUE(std::is_sorted(own[thread].begin(), own[thread].end()));
    EXPECT_TRUE(std::is_sorted(others[thread].rbegin(), others[thread].rend()));
  }
}

TEST(ParallelFor, CallersOnSeveralThreadsDoNotDisturbEachOther) {
  std::vector<std::thread> callers;
  std::atomic<int> total{0};
  for (int c = 0; c < 3; ++c) {
    callers.emplace_back([&] {
      for (int round = 0; round < 200; ++round) {
        ParallelFor(1 + round % 4, 7, [&](size_t, int) { ++total; });
      }
    });
  }
  for (std::thread& caller : callers) caller.join();
  EXPECT_EQ(total.load(), 3 * 200 * 7);
}

TEST(ParallelFor, LoopsInsideLoopsRun) {
  std::atomic<int> total{0};
  ParallelFor(3, 5, [&](size_t, int) { ParallelFor(3, 4, [&](size_t, int) { ++total; }); });
  EXPECT_EQ(total.load(), 20);
}

TEST(CounterRng, HasTheMomentsItClaims) {
  const CounterRng rng(1, 2);
  constexpr int kDraws = 20000;
  double mean = 0, var = 0, uniform = 0;
  for (int i = 0; i < kDraws; ++i) {
    const double x = rng.Normal(i);
    mean += x;
    var += x * x;
    uniform += rng.Uniform(i);
    EXPECT_LT(rng.Below(i, 7), 7u);
  }
  // Five standard errors of each estimate.
  EXPECT_NEAR(mean / kDraws, 0, 5 / std::sqrt(kDraws));
  EXPECT_NEAR(var / kDraws, 1, 5 * std::sqrt(2.0 / kDraws));
  EXPECT_NEAR(uniform / kDraws, 0.5, 5 * std::sqrt(1.0 / 12 / kDraws));
  EXPECT_NE(rng.Bits(0), CounterRng(1, 3).Bits(0));
}

TEST(Utf8, PrefixesEndBetweenCharactersAndInvalidBytesAreReplaced) {
  EXPECT_EQ(Utf8Prefix("Küche", 2), "K");
  EXPECT_EQ(Utf8Prefix("Küche", 3), "Kü");
  EXPECT_EQ(Utf8Prefix("Küche", 100), "Küche");
  EXPECT_EQ(Utf8Prefix("a\xFF\xE5\x86z", 100), "a\uFFFD\uFFFD\uFFFDz");
  EXPECT_EQ(Utf8Prefix("\xFF\xFF", 4), "\uFFFD");
}

TEST(Splats, NamesTheFirstGaussianThatIsNotFinite) {
  Splats splats(37);
  EXPECT_EQ(splats.FirstNotFinite(), 37u);
  splats.at(36, kShRest + 44) = INFINITY;
  EXPECT_EQ(splats.FirstNotFinite(), 36u);
  splats.at(20, kMean) = -std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(splats.FirstNotFinite(), 20u);
  splats.at(20, kMean) = std::numeric_limits<float>::max();
  splats.at(36, kShRest + 44) = std::numeric_limits<float>::denorm_min();
  EXPECT_EQ(splats.FirstNotFinite(), 37u);
}

TEST(Splats, ResizeKeepsAndClears) {
  Splats splats(20);
  for (size_t i = 0; i < 20; ++i) splats.at(i, kMean) = float(i + 1);
  splats.Resize(17);
  splats.Resize(40);
  EXPECT_EQ(splats.at(16, kMean), 17);
  for (size_t i = 17; i < 40; ++i) EXPECT_EQ(splats.at(i, kMean), 0);
}

TEST(ShrunkSize, KeepsTheShape) {
  const auto shrunk = [](int width, int height, int max_side) {
    const PictureSize size = ShrunkSize(width, height, max_side);
    return std::pair(size.width, size.height);
  };
  EXPECT_EQ(shrunk(4032, 3024, 1600), std::pair(1600, 1200));
  EXPECT_EQ(shrunk(3024, 4032, 1600), std::pair(1200, 1600));
  EXPECT_EQ(shrunk(1000, 665, 100), std::pair(100, 67));  // 66.5
  EXPECT_EQ(shrunk(800, 600, 1600), std::pair(800, 600));
  EXPECT_EQ(shrunk(4032, 3024, 0), std::pair(4032, 3024));  // any
  EXPECT_EQ(shrunk(100000, 10, 64), std::pair(64, 1));
}

TEST(Image, BytesSurviveTheRoundTrip) {
  ImageU8 image(256, 1);
  for (int x = 0; x < 256; ++x) image.pixel(x, 0)[1] = uint8_t(x);
  EXPECT_EQ(ToImageU8(ToPlanes(image)).data, image.data);
}

TEST(Image, OnePlaneBecomesGrey) {
  Planes depth(1, 1, 2);
  depth.data = {0.2f, 1.0f};
  EXPECT_EQ(ToImageU8(depth).data, (std::vector<uint8_t>{51, 51, 51, 255, 255, 255}));
}

}  // namespace
}  // namespace litags
