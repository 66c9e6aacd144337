#include "server/api/camera_path.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "engine/core/error_test_util.h"
#include "server/api/view_request.h"

namespace litags {
namespace {

using ::testing::DoubleNear;
using ::testing::Pointwise;

// Photos on a circle about the origin, at the height of its centre. Up is -y.
class CircleScene : public Scene {
 public:
  explicit CircleScene(const std::vector<double>& degrees) {
    for (const double d : degrees) {
      const double angle = d * M_PI / 180;
      EXPECT_TRUE(views_.emplace_back()
                      .camera.LookAt({std::cos(angle), 0, std::sin(angle)}, {0, 0, 0}, up())
                      .ok());
    }
  }
  const std::vector<View>& views() const override { return views_; }
  int64_t num_gaussians() const override { return 0; }
  int iteration() const override { return 0; }
  std::array<double, 3> center() const override { return {0, 0, 0}; }
  std::array<double, 3> up() const override { return {0, -1, 0}; }
  double radius() const override { return 1; }
  absl::StatusOr<Planes> Render(const RenderRequest&) const override {
    return absl::UnimplementedError("nothing to see");
  }
  absl::StatusOr<int64_t> Export(const std::string&, const ExportRequest&) const override {
    return absl::UnimplementedError("nothing to write");
  }
  absl::Status ExportFullPly(const std::string&) const override {
    return absl::UnimplementedError("nothing to write");
  }
  absl::Status Save(const std::string&) const override {
    return absl::UnimplementedError("nothing to write");
  }

 private:
  std::vector<View> views_;
};

// Where the frames of an orbit stand, degrees in -180..180.
std::vector<double> OrbitOf(const std::vector<double>& photos, int frames,
                            std::optional<double> sweep_deg = {}) {
  v1::RenderPathRequest request;
  request.set_frames(frames);
  request.mutable_orbit();
  if (sweep_deg) request.mutable_orbit()->set_sweep_deg(*sweep_deg);
  const auto cameras = ResolvePath(request, Camera(), CircleScene(photos));
  EXPECT_TRUE(cameras.ok()) << cameras.status();
  std::vector<double> degrees;
  for (const Camera& camera : *cameras) {
    const auto center = camera.Center();
    degrees.push_back(std::atan2(center[2], center[0]) * 180 / M_PI);
  }
  return degrees;
}

auto AreNear(const std::vector<double>& degrees) { return Pointwise(DoubleNear(1e-6), degrees); }

TEST(Orbit, WithoutATurnTheCameraStandsStill) {
  EXPECT_THAT(OrbitOf({0, 90, 180, 270}, 5, 0), AreNear({0, 0, 0, 0, 0}));
}

TEST(Keyframes, AreBoundedAndEndWhenNobodyWaits) {
  const CircleScene scene({0, 90});
  v1::RenderPathRequest request;
  for (int i = 0; i < 10'000; ++i) {
    v1::LookAt* look = request.mutable_keyframes()->add_poses()->mutable_look_at();
    look->mutable_eye()->set_x(1 + i);
    look->mutable_target()->set_x(0);
  }
  EXPECT_TRUE(ResolvePath(request, Camera(), scene).ok());
  CancelToken cancel;
  cancel.Cancel();
  EXPECT_TRUE(absl::IsCancelled(ResolvePath(request, Camera(), scene, cancel).status()));
  *request.mutable_keyframes()->add_poses() = request.keyframes().poses(0);
  EXPECT_EQ(Reason(ResolvePath(request, Camera(), scene).status()), "TOO_MANY_KEYFRAMES");
}

TEST(Orbit, GoesThereAndBackAlongTheArcThatThePhotosCover) {
  // In either direction: the film is the same backwards.
  EXPECT_THAT(OrbitOf({60, 0, 120}, 4),
              ::testing::AnyOf(AreNear({0, 60, 120, 60}), AreNear({120, 60, 0, 60})));
  // Across the direction of the first photo, and where angles begin anew.
  EXPECT_THAT(OrbitOf({170, -160, 140}, 4),
              ::testing::AnyOf(AreNear({140, 170, -160, 170}), AreNear({-160, 170, 140, 170})));
}

TEST(Orbit, GoesAllAroundIfThePhotosDoOrIfAsked) {
  const auto around = OrbitOf({10, 100, -170, -80}, 4);
  EXPECT_NEAR(around[0], 10, 1e-6);
  EXPECT_NEAR(std::abs(around[2]), 170, 1e-6);
  const auto asked = OrbitOf({10, 20}, 4, 360);
  EXPECT_NEAR(asked[0], 10, 1e-6);
  EXPECT_NEAR(std::abs(asked[2]), 170, 1e-6);
  const auto part = OrbitOf({10, 20}, 3, -90);
  EXPECT_NEAR(std::abs(part[2] - part[0]), 90, 1e-6);
}

TEST(ResolveLens, NeedsACameraOfTheScene) {
  EXPECT_EQ(Reason(ResolveLens({}, "", "pose.camera", CircleScene({}), 100).status()),
            "SCENE_WITHOUT_CAMERAS");
}

}  // namespace
}  // namespace litags
