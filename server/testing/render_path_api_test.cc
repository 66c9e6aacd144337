// Paths through the scene of a job over the fake engine.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <string>
#include <vector>

#include "engine/core/camera.h"
#include "server/testing/api_fixture.h"

namespace litags {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

class PathApi : public ApiTest {
 protected:
  void SetUp() override {
    path_.set_name(FinishedJob());
    request_.set_name(path_.name());
  }

  grpc::Status Path(std::vector<v1::RenderPathResponse>* frames) {
    grpc::ClientContext context;
    const auto reader = client_.render->RenderPath(&context, path_);
    v1::RenderPathResponse frame;
    while (reader->Read(&frame)) frames->push_back(frame);
    return reader->Finish();
  }

  // The reason and the field of the path's refusal.
  std::string Refusal() {
    std::vector<v1::RenderPathResponse> frames;
    const auto detail = DetailOf(Path(&frames));
    EXPECT_TRUE(frames.empty());
    return detail.reason + " " + detail.field;
  }

  // Camera centre of a frame: -R^T t.
  static std::array<double, 3> Center(const v1::RenderPathResponse& frame) {
    Camera camera;
    std::array<double, 16> viewmat;
    const auto& values = frame.view().camera().viewmat().values();
    std::copy(values.begin(), values.end(), viewmat.begin());
    camera.SetViewmat(viewmat);
    return camera.Center();
  }

  v1::RenderPathRequest path_;
  v1::RenderViewRequest request_;  // one picture to compare with
};

TEST_F(PathApi, OrbitStaysOnItsCircleAndComesInOrder) {
  path_.mutable_orbit()->set_radius_scale(0.5);
  path_.mutable_orbit()->set_elevation_deg(30);
  path_.mutable_orbit()->set_sweep_deg(360);
  path_.set_frames(8);
  std::vector<v1::RenderPathResponse> frames;
  const grpc::Status status = Path(&frames);
  ASSERT_TRUE(status.ok()) << status.error_message();
  ASSERT_EQ(frames.size(), 8u);
  for (size_t i = 0; i < frames.size(); ++i) {
    EXPECT_EQ(frames[i].frame(), static_cast<int>(i));
    EXPECT_EQ(frames[i].frames(), 8);
    const auto c = Center(frames[i]);
    EXPECT_NEAR(std::sqrt(c[0] * c[0] + c[1] * c[1] + c[2] * c[2]), 2, 1e-9);
    EXPECT_NEAR(c[1], -1, 1e-9);  // up is -y: 2 sin 30 degrees above
  }
  const auto first = Center(frames[0]), half = Center(frames[4]);
  EXPECT_NEAR(first[0], -half[0], 1e-9);
  EXPECT_NEAR(first[2], -half[2], 1e-9);
}

TEST_F(PathApi, KeyframesAreOnThePath) {
  path_.mutable_keyframes()->add_poses()->set_camera("a.png");
  path_.mutable_keyframes()->add_poses()->set_camera("b.png");
  path_.mutable_keyframes()->add_poses()->set_camera("c.png");
  path_.set_frames(5);
  std::vector<v1::RenderPathResponse> frames;
  const grpc::Status status = Path(&frames);
  ASSERT_TRUE(status.ok()) << status.error_message();
  ASSERT_EQ(frames.size(), 5u);
  const std::string names[] = {"a.png", "b.png", "c.png"};
  for (int i = 0; i < 3; ++i) {
    request_.mutable_pose()->set_camera(names[i]);
    v1::RenderedView view;
    ASSERT_TRUE(client_.Render(request_, &view).ok());
    for (int k = 0; k < 16; ++k) {
      EXPECT_NEAR(view.camera().viewmat().values(k),
                  frames[2 * i].view().camera().viewmat().values(k), 1e-9);
    }
  }
}

TEST_F(PathApi, LightAndExposureGoEvenlyFromTheFirstFrameToTheLast) {
  // Twice the same camera: only the light moves.
  path_.mutable_keyframes()->add_poses()->set_camera("a.png");
  path_.mutable_keyframes()->add_poses()->set_camera("a.png");
  path_.mutable_settings()->set_format(v1::PICTURE_FORMAT_RAW_FLOAT);
  path_.mutable_light()->set_first(1);
  path_.mutable_light()->set_last(-1);
  path_.mutable_exposure_stops()->set_last(2);
  path_.set_frames(5);
  std::vector<v1::RenderPathResponse> frames;
  const grpc::Status status = Path(&frames);
  ASSERT_TRUE(status.ok()) << status.error_message();
  ASSERT_EQ(frames.size(), 5u);
  for (int i = 0; i < 5; ++i) {
    EXPECT_DOUBLE_EQ(frames[i].view().light(), 1 - 0.5 * i);
    EXPECT_DOUBLE_EQ(frames[i].view().exposure_stops(), 0.5 * i);
    // As one picture with these settings.
    request_.mutable_pose()->set_camera("a.png");
    request_.mutable_settings()->set_format(v1::PICTURE_FORMAT_RAW_FLOAT);
    request_.mutable_settings()->set_channel(v1::CHANNEL_LIGHT);
    request_.mutable_settings()->set_light(1 - 0.5 * i);
    request_.mutable_settings()->set_exposure_stops(0.5 * i);
    v1::RenderedView view;
    ASSERT_TRUE(client_.Render(request_, &view).ok());
    EXPECT_EQ(view.light(), frames[i].view().light());
    float first = 0, single = 0;
    std::memcpy(&first, frames[i].view().data().data(), sizeof(first));
    std::memcpy(&single, view.data().data(), sizeof(single));
    EXPECT_NEAR(first, single, 1e-6);  // interpolated rotations are orthonormal to rounding only
  }
}

TEST_F(PathApi, BadLightsAndExposuresAreRefusedWithTheirField) {
  path_.mutable_orbit();
  path_.mutable_light()->set_first(kNan);
  EXPECT_EQ(Refusal(), "LIGHT_INVALID light.first");
  path_.mutable_light()->set_first(0);
  path_.mutable_light()->set_last(4.5);
  EXPECT_EQ(Refusal(), "LIGHT_INVALID light.last");
  path_.mutable_light()->set_last(1);
  path_.mutable_settings()->set_channel(v1::CHANNEL_DEPTH);
  EXPECT_EQ(Refusal(), "LIGHT_INVALID light");
  path_.mutable_settings()->set_channel(v1::CHANNEL_LIGHT);
  path_.mutable_settings()->set_light(0.5);
  EXPECT_EQ(Refusal(), "LIGHT_INVALID light");
  path_.clear_light();
  path_.mutable_settings()->Clear();
  path_.mutable_exposure_stops()->set_first(-11);
  EXPECT_EQ(Refusal(), "EXPOSURE_INVALID exposure_stops.first");
  path_.mutable_exposure_stops()->set_first(1);
  path_.mutable_settings()->set_exposure_stops(1);
  EXPECT_EQ(Refusal(), "EXPOSURE_INVALID exposure_stops");
  path_.mutable_settings()->Clear();
  path_.mutable_settings()->set_channel(v1::CHANNEL_ALPHA);
  EXPECT_EQ(Refusal(), "EXPOSURE_INVALID exposure_stops");
}

TEST_F(PathApi, BadPathsAreRefusedWithTheirField) {
  EXPECT_EQ(Refusal(), "PATH_MISSING path");
  path_.mutable_keyframes()->add_poses()->set_camera("a.png");
  std::vector<v1::RenderPathResponse> frames;
  const grpc::Status one = Path(&frames);
  EXPECT_EQ(DetailOf(one).reason, "TOO_FEW_KEYFRAMES");
  EXPECT_THAT(one.error_message(), ::testing::HasSubstr("a path through 1 pose;"));
  path_.mutable_keyframes()->add_poses()->mutable_look_at()->mutable_eye()->set_z(kNan);
  EXPECT_EQ(Refusal(), "POSE_NOT_FINITE keyframes.poses[1].look_at.eye");
  path_.mutable_orbit()->set_elevation_deg(90);
  EXPECT_EQ(Refusal(), "ORBIT_INVALID orbit.elevation_deg");
  path_.mutable_orbit()->clear_elevation_deg();
  path_.mutable_orbit()->set_radius_scale(1e308);
  EXPECT_EQ(Refusal(), "ORBIT_INVALID orbit.radius_scale");
  path_.mutable_orbit()->set_radius_scale(1);
  path_.mutable_orbit()->set_sweep_deg(1e308);
  EXPECT_EQ(Refusal(), "ORBIT_INVALID orbit.sweep_deg");
  path_.mutable_keyframes()->add_poses()->set_camera("none.png");
  EXPECT_EQ(Refusal(), "CAMERA_NOT_FOUND keyframes.poses[0].camera");
  path_.mutable_orbit();
  path_.set_frames(-1);
  EXPECT_EQ(Refusal(), "FRAMES_INVALID frames");
}

}  // namespace
}  // namespace litags
