#include "client/report/cameras.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace litags::report {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

// At (x, 0, z), looking along z; y is down.
void AddCamera(v1::ListCamerasResponse& cameras, const std::string& name, double x, double z) {
  v1::NamedCamera* named = cameras.add_cameras();
  named->set_name(name);
  named->mutable_camera()->set_width(64);
  named->mutable_camera()->set_height(48);
  for (const double value :
       {1.0, 0.0, 0.0, -x, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, -z, 0.0, 0.0, 0.0, 1.0}) {
    named->mutable_camera()->mutable_viewmat()->add_values(value);
  }
}

v1::ListCamerasResponse TwoCameras() {
  v1::ListCamerasResponse cameras;
  cameras.mutable_up()->set_y(-1);
  cameras.mutable_center();
  AddCamera(cameras, "a.png", -2, -4);
  AddCamera(cameras, "b.png", 2, -4);
  return cameras;
}

TEST(Cameras, APhotoLeftOutHasTheReasonOfItsNote) {
  v1::JobReport report;
  for (const char* name : {"a.jpg", "b.jpg", "c.jpg"}) report.add_dropped(name);
  report.add_notes("a.jpg is left out: it is all black");
  report.add_notes("b.jpg is left out: the same as c.jpg");
  report.add_notes("no depth maps");
  std::vector<std::string> others;
  const std::vector<LeftOut> left_out = PhotosLeftOut(report, &others);
  ASSERT_EQ(left_out.size(), 3u);
  EXPECT_EQ(left_out[0].why, "is all black");
  EXPECT_EQ(left_out[1].why, "the same as c.jpg");
  EXPECT_THAT(left_out[2].why, HasSubstr("no camera"));
  EXPECT_THAT(others, ElementsAre("no depth maps"));
}

TEST(Cameras, ThePlanHasEachCameraAtItsPlace) {
  v1::JobReport report;
  report.set_photos(3);
  report.set_registered(2);
  const std::string html = CamerasSection(report, {}, TwoCameras()).markup();
  EXPECT_THAT(html, HasSubstr("2 of 3"));
  EXPECT_THAT(html, HasSubstr("<title>a.png</title>"));
  EXPECT_THAT(html, HasSubstr("<dt>Sizes of the pictures, px</dt><dd>2 of 64x48</dd>"));
  // The ground is 4 by 4 units: from -2 to 2, and from the cameras to the centre.
  EXPECT_THAT(html, HasSubstr("cx=\"24.0\""));
  EXPECT_THAT(html, HasSubstr("cx=\"296.0\""));
  EXPECT_THAT(html, HasSubstr("No photo was left out"));
}

TEST(Cameras, WithoutASceneThereIsNoPlan) {
  EXPECT_THAT(CamerasSection({}, {}, {}).markup(), Not(HasSubstr("<svg")));
}

}  // namespace
}  // namespace litags::report
