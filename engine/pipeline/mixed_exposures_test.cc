// Captures of which some photos are darker than others: phones choose an exposure for each photo.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <numeric>
#include <string>
#include <vector>

#include "absl/strings/str_join.h"
#include "engine/core/color.h"
#include "engine/eval/metrics.h"
#include "engine/pipeline/capture_test_util.h"
#include "engine/pipeline/posed_photos.h"
#include "engine/pipeline/train_set.h"

namespace litags {
namespace {

ReconstructOptions Options(const RoomCapture& room) {
  ReconstructOptions options = room.Options(10);
  options.holdout_every = 0;
  return options;
}

Light LightOf(int i) {
  return i % 3 == 0 ? Light::kLow : i % 3 == 1 ? Light::kNormal : Light::kOver;
}

double MeanCode(const ImageU8& photo) {
  return std::accumulate(photo.data.begin(), photo.data.end(), 0.0) / photo.data.size();
}

// Mean size of the difference of luma, 8-bit codes: what evens out colours leaves it.
double LumaDifference(const Photo& photo, const ImageU8& taken) {
  constexpr float kLuma[] = {kLumaRed, kLumaGreen, kLumaBlue};
  const Photo other = PhotoFromU8(taken);
  double sum = 0;
  for (size_t i = 0; i < photo.pixels(); ++i) {
    double difference = 0;
    for (int c = 0; c < 3; ++c)
      difference += kLuma[c] * (photo.data[3 * i + c] - other.data[3 * i + c]);
    sum += std::abs(difference) / kPhotoCode;
  }
  return sum / photo.pixels();
}

TEST(MixedExposures, PhotosAreComparedAtOneExposure) {
  RoomCapture room(9);
  room.SetLight(LightOf);
  const TrainSet capture = room.Load(Options(room));
  ASSERT_EQ(capture.train.size(), 9u);
  for (int i = 0; i < 9; ++i) {
    const TrainView& view = capture.train[i];
    const ImageU8 taken = room.Photo(i, LightOf(i));
    if (LightOf(i) == Light::kNormal) {
      EXPECT_LT(LumaDifference(view.photo, taken), 1) << "the median photo stays as it is";
      EXPECT_NEAR(std::log2(view.exposure), 0, 0.3);
    } else {
      const double normal = MeanCode(room.Photo(i, Light::kNormal));
      const auto off = [&](const ImageU8& p) { return std::abs(std::log2(MeanCode(p) / normal)); };
      EXPECT_GT(off(taken), 0.5);
      EXPECT_LT(off(PhotoToU8(view.photo)), 0.5 * off(taken));
    }
  }
}

// So their score does not tell of their exposure, nor do theirs move their fitted cameras.
TEST(MixedExposures, HeldOutPhotosAreComparedAtTheExposureOfTheOthers) {
  RoomCapture room(9);
  ReconstructOptions options = Options(room);
  options.holdout_every = 4;  // of 9 photos, 2 and 6
  const auto load = [&](Light light) {
    room.SetLight([&](int i) { return i == 2 ? light : Light::kNormal; });
    return room.Load(options);
  };
  const TrainSet alike = load(Light::kNormal), darker = load(Light::kLow);
  ASSERT_EQ(alike.holdout.size(), 2u);
  ASSERT_EQ(darker.holdout.size(), 2u);
  const auto stops = [](const Photo& a, const Photo& b) {
    return std::abs(std::log2(MeanCode(PhotoToU8(a)) / MeanCode(PhotoToU8(b))));
  };
  const TrainView &held = darker.holdout[0], &before = alike.holdout[0];
  ASSERT_EQ(held.view.name, RoomCapture::Name(2));
  EXPECT_GT(stops(PhotoFromU8(room.Photo(2, Light::kLow)), before.photo), 1.5) << "as it was taken";
  EXPECT_LT(held.exposure, 0.5);
  EXPECT_LT(stops(held.photo, before.photo), 0.5);
  EXPECT_LT(stops(held.target, before.target), 0.25);
}

// Views of panoramas are PNG files, which say nothing of it.
TEST(MixedExposures, AViewHasTheExposureThatItsPhotoStates) {
  const RoomCapture room(4);
  CutInput input(room.Input("work"));
  input.rig_views[RoomCapture::Name(2)] = {
      .rig = "p.jpg", .exposure_time = 0.5, .iso = 200, .f_number = 2};
  const ReconstructOptions options = Options(room);
  const CancelToken never;
  ReconstructReport report;
  const Context context(
      input, options, never, [](Stage, const std::string&) {}, &report);
  const auto posed = LoadPosedPhotos(context, kNoColmap);
  ASSERT_TRUE(posed.ok()) << posed.status();
  EXPECT_THAT(posed->stated_exposures, testing::ElementsAre(0, 0, 25, 0));
}

// Black photos are left out, and have no say in the colours of the others' shadows.
TEST(MixedExposures, BlackPhotosDoNotChangeTheOthersShadows) {
  const auto shadows = [](bool all) {
    RoomCapture room(8);
    for (int i = 3; i < 8; ++i) {
      room.SetPhoto(i, ImageU8(RoomCapture::kWidth, RoomCapture::kHeight));
      if (!all) std::filesystem::remove(room.Path("images/" + room.Name(i)));
    }
    const ReconstructInput input = room.Input("work");
    const ReconstructOptions options = Options(room);
    const CancelToken never;
    ReconstructReport report;
    const Context context(
        input, options, never, [](Stage, const std::string&) {}, &report);
    auto posed = LoadPosedPhotos(context, kNoColmap);
    EXPECT_TRUE(posed.ok()) << posed.status();
    std::vector<std::vector<int16_t>> samples;
    for (const Photo& photo : posed->photos) samples.push_back(photo.data);
    return samples;
  };
  const auto with = shadows(true);
  EXPECT_EQ(with.size(), 3u);
  EXPECT_EQ(with, shadows(false));
}

TEST(MixedExposures, PixelsCountByHowWellTheirPhotoKnowsThem) {
  RoomCapture room(9);
  room.SetLight(LightOf);
  const TrainSet capture = room.Load(Options(room));
  ASSERT_EQ(capture.train.size(), 9u);
  double clipped = 0, clipped_weight = 0, other = 0, other_weight = 0;
  for (int i = 2; i < 9; i += 3) {
    const ImageU8 taken = room.Photo(i, Light::kOver);
    for (size_t k = 0; k < taken.data.size() / 3; ++k) {
      const uint8_t* code = &taken.data[3 * k];
      const bool white = std::min({code[0], code[1], code[2]}) == 255;
      const bool dark = std::max({code[0], code[1], code[2]}) < 200;
      if (white) ++clipped, clipped_weight += capture.train[i].information.data[k];
      if (dark) ++other, other_weight += capture.train[i].information.data[k];
    }
  }
  ASSERT_GT(clipped, 100);
  ASSERT_GT(other, 100);
  EXPECT_LT(clipped_weight / clipped, 0.9 * other_weight / other);

  ReconstructOptions alike = Options(room);
  alike.recipe->information_weights = false;
  const TrainSet plain = room.Load(alike);
  ASSERT_EQ(plain.train.size(), capture.train.size());
  for (const TrainView& view : plain.train) EXPECT_TRUE(view.information.empty());
}

TEST(MixedExposures, PhotosOfOneExposureStayAsTheyAre) {
  const RoomCapture room(6);  // all dark
  const TrainSet capture = room.Load(Options(room));
  ASSERT_EQ(capture.train.size(), 6u);
  for (int i = 0; i < 6; ++i) {
    EXPECT_LT(LumaDifference(capture.train[i].photo, room.Photo(i, Light::kLow)), 0.5);
    EXPECT_TRUE(capture.train[i].information.empty());
  }
}

TEST(MixedExposures, ThePaperComparesWithThePhotosAsTheyAre) {
  RoomCapture room(6);
  room.SetLight(LightOf);
  ReconstructOptions options = Options(room);
  options.tone = Tone::kPaper;
  const TrainSet capture = room.Load(options);
  ASSERT_EQ(capture.train.size(), 6u);
  for (int i = 0; i < 6; ++i) {
    EXPECT_EQ(capture.train[i].photo.data, PhotoFromU8(room.Photo(i, LightOf(i))).data);
  }
}

struct Trained {
  double ssim = NAN;  // mean over the views, to the normally lit photos
  std::string notes;
};

template <class LightOf>
Trained TrainIn(const LightOf& light_of) {
  RoomCapture room(12);
  room.SetLight(light_of);
  ReconstructOptions options = room.Options(400);
  options.recipe = Litags();
  options.recipe->dropout =
      0;  // holds short runs on small photos back, the more the noisier they are
  const auto report = Train(room.Input("work"), options);
  EXPECT_TRUE(report.ok()) << report.status();
  if (!report.ok()) return {};
  const auto scene = MakeEngine()->LoadScene(report->scene_path);
  EXPECT_TRUE(scene.ok()) << scene.status();
  double sum = 0;
  for (int i = 0; i < room.views(); ++i) {
    RenderRequest request;
    request.camera = (*scene)->views()[i].camera;
    sum += *Ssim(*(*scene)->Render(request), ToPlanes(room.Photo(i, Light::kNormal)));
  }
  return {sum / room.views(), absl::StrJoin(report->notes, "; ")};
}

TEST(MixedExposures, OverExposedPhotosGainByOthers) {
  const Trained dark = TrainIn([](int) { return Light::kLow; });
  const Trained over = TrainIn([](int) { return Light::kOver; });
  const Trained mixed = TrainIn(LightOf);
  EXPECT_GT(mixed.ssim, over.ssim);
  EXPECT_GT(mixed.ssim, dark.ssim - 0.03);
  EXPECT_THAT(mixed.notes, testing::HasSubstr("they are evened out, and the original light"));
}

}  // namespace
}  // namespace litags
