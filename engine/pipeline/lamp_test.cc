// Captures lit by a lamp or a flash that the camera carries.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "engine/core/color.h"
#include "engine/pipeline/capture_test_util.h"

namespace litags {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;

TEST(Lamp, IsFoundWhereThereIsOne) {
  RoomCapture room(24);
  room.TrackPointsEverywhere();
  EXPECT_EQ(room.Load(room.Options(10)).train[0].lamp.power, 0);
  room.LightByLamp();
  const TrainSet set = room.Load(room.Options(10));
  ASSERT_FALSE(set.train.empty());
  for (const TrainView& view : set.train) ASSERT_NEAR(2.2 * view.lamp.power, 2, 0.4);
}

// How the codes of pictures fall with the distance, beside those of the truth: the slope of their
// ratio, both as logarithms.
class Slope {
 public:
  void Add(const ImageU8& picture, const ImageU8& truth, const Planes& depth) {
    for (size_t i = 0; i < depth.data.size(); ++i) {
      const double code = picture.data[3 * i + 1], right = truth.data[3 * i + 1];
      if (code < 20 || right < 20 || right > 250 || code > 250) continue;
      const double x = std::log(depth.data[i]), y = std::log(code / right);
      n_ += 1, x_ += x, y_ += y, xx_ += x * x, xy_ += x * y;
    }
  }
  double Value() const { return (n_ * xy_ - x_ * y_) / (n_ * xx_ - x_ * x_); }

 private:
  double n_ = 0, x_ = 0, y_ = 0, xx_ = 0, xy_ = 0;
};

TEST(Lamp, TheSceneIsLitEvenly) {
  RoomCapture room(24);
  room.TrackPointsEverywhere();
  room.LightByLamp();
  ReconstructOptions options = room.Options(400);
  options.recipe = Litags();
  options.holdout_every = 0;
  const ReconstructInput input = room.Input("lamp");
  const auto engine = MakeEngine(kNoColmap);
  const auto report = engine->Reconstruct(input, options, {}, nullptr);
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_THAT(report->notes, Contains(HasSubstr("as that of a lamp")));
  const auto scene = engine->LoadScene(input.work_dir + "/scene.litags");
  ASSERT_TRUE(scene.ok()) << scene.status();
  const TrainSet set = room.Load(options);
  Slope photos, pictures;
  for (int i = 0; i < room.views(); ++i) {
    RenderRequest request;
    request.camera = room.model.views[i].camera;
    const auto picture = (*scene)->Render(request);
    ASSERT_TRUE(picture.ok()) << picture.status();
    const ImageU8 truth = room.Photo(i, Light::kNormal);
    photos.Add(PhotoToU8(set.train[i].target), truth, room.Depth(i));
    pictures.Add(ToImageU8(*picture), truth, room.Depth(i));
  }
  EXPECT_LT(photos.Value(), -0.9);  // light by the square, codes by less than half of it
  EXPECT_NEAR(pictures.Value(), 0, 0.45);
}

}  // namespace
}  // namespace litags
