// Captures of extreme light: each ends in a picture that a person would accept, or in words that
// say what could not be known; never in a black or a white frame without a word.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "engine/core/color.h"
#include "engine/core/error_test_util.h"
#include "engine/core/rng.h"
#include "engine/io/file_util.h"
#include "engine/io/testing_formats.h"
#include "engine/pipeline/capture_checks.h"
#include "engine/pipeline/capture_test_util.h"

namespace litags {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr int kViews = 8;
constexpr char kMostlyBlack[] = "pixels are below code 1 of 255";
constexpr char kNarrow[] = "of 16 bits, such as v000.png, are below 256";

// Gives every photo codes made of those of normal light, in [0, 255], with noise of `sigma` codes.
void SetCodes(RoomCapture* capture, double sigma, const std::function<double(double)>& code_of) {
  for (int i = 0; i < capture->views(); ++i) {
    ImageU8 photo = capture->Photo(i, Light::kNormal);
    const CounterRng rng(i, 3);
    for (size_t k = 0; k < photo.data.size(); ++k) {
      const double code = code_of(photo.data[k]) + sigma * rng.Normal(k);
      photo.data[k] = static_cast<uint8_t>(std::clamp(std::round(code), 0.0, 255.0));
    }
    capture->SetPhoto(i, photo);
  }
}

// A code of a photo exposed `stops` shorter.
double Darkened(double code, double stops) {
  return 255 * SrgbFromLinear(LinearFromSrgb(code / 255) * std::exp2(-stops));
}

// The samples of the first view, encoded.
struct Look {
  double mean = 0;
  double range = 0;  // from the 10 % quantile to the 90 % one
};

Look LookOf(const ReconstructReport& report) {
  Look look;
  const auto scene = MakeEngine()->LoadScene(report.scene_path);
  EXPECT_TRUE(scene.ok()) << scene.status();
  if (!scene.ok()) return look;
  RenderRequest request;
  request.camera = (*scene)->views()[0].camera;
  const auto picture = (*scene)->Render(request);
  EXPECT_TRUE(picture.ok()) << picture.status();
  if (!picture.ok()) return look;
  std::vector<float> values = picture->data;
  for (const float v : values) {
    EXPECT_TRUE(std::isfinite(v));
    look.mean += v / values.size();
  }
  std::sort(values.begin(), values.end());
  look.range = values[values.size() * 9 / 10] - values[values.size() / 10];
  return look;
}

void ExpectPicture(const absl::StatusOr<ReconstructReport>& report) {
  ASSERT_TRUE(report.ok()) << report.status();
  const Look look = LookOf(*report);
  EXPECT_GT(look.mean, 0.1);  // half of a picture may be a black sky
  EXPECT_LT(look.mean, 0.8);
  EXPECT_GT(look.range, 0.2);
}

TEST(ExtremeLight, CodesOfZeroAndOneMakeAPictureAndANote) {
  RoomCapture capture(kViews);
  SetCodes(&capture, 0.25, [](double code) { return Darkened(code, 10); });
  const auto report = Train(capture.Input("work"), capture.Options(80));
  ExpectPicture(report);
  EXPECT_THAT(report->notes, Contains(HasSubstr(kMostlyBlack)));
}

TEST(ExtremeLight, DarkPhotosThatShowTheirShadowsNeedNoNote) {
  const RoomCapture capture(kViews);
  const auto report = Train(capture.Input("work"), capture.Options(40));
  ExpectPicture(report);
  EXPECT_THAT(report->notes, Not(Contains(HasSubstr(kMostlyBlack))));
  EXPECT_THAT(report->notes, Not(Contains(HasSubstr("of 16 bits"))));
}

// One lamp, and nothing else that a pixel could tell; a lamp of few pixels is noise for the prior.
TEST(ExtremeLight, ALampInTheDarkIsALampAndANote) {
  for (const double radius : {4.0, 1.5}) {
    RoomCapture capture(kViews);
    const std::array<double, 3> lamp = capture.model.points[0].xyz;
    for (int i = 0; i < kViews; ++i) {
      ImageU8 photo(RoomCapture::kWidth, RoomCapture::kHeight);
      const Camera& camera = capture.model.views[i].camera;
      const auto at = camera.CamFromWorld(lamp);
      const double u = camera.fx * at[0] / at[2] + camera.cx;
      const double v = camera.fy * at[1] / at[2] + camera.cy;
      for (int y = 0; y < photo.height; ++y) {
        for (int x = 0; x < photo.width; ++x) {
          if (at[2] < 0 || std::hypot(x + 0.5 - u, y + 0.5 - v) > radius) continue;
          std::fill_n(photo.pixel(x, y), 3, 250);
        }
      }
      capture.SetPhoto(i, photo);
    }
    const auto report = Train(capture.Input("work"), capture.Options(80));
    ASSERT_TRUE(report.ok()) << report.status();
    EXPECT_THAT(report->notes, Contains(HasSubstr(kMostlyBlack)));
    const Look look = LookOf(*report);
    EXPECT_TRUE(std::isfinite(look.mean));
    EXPECT_LT(look.mean, 0.5);
  }
}

TEST(ExtremeLight, ANightSkyOverADarkPlace) {
  RoomCapture capture(kViews);
  for (int i = 0; i < kViews; ++i) {
    ImageU8 photo = capture.Photo(i, Light::kNormal);
    const CounterRng rng(i, 4);
    for (int y = 0; y < photo.height; ++y) {
      for (int x = 0; x < photo.width; ++x) {
        const size_t k = size_t(y) * photo.width + x;
        const bool star = y < photo.height / 2 && rng.Below(k, 200) == 0;
        for (int c = 0; c < 3; ++c) {
          uint8_t& code = photo.pixel(x, y)[c];
          const double place = y < photo.height / 2 ? 0 : Darkened(code, 7);
          code = static_cast<uint8_t>(
              star ? 120 : std::max(0.0, std::round(place + 0.4 * rng.Normal(3 * k + c + 10000))));
        }
      }
    }
    capture.SetPhoto(i, photo);
  }
  const auto report = Train(capture.Input("work"), capture.Options(80));
  ExpectPicture(report);
}

TEST(ExtremeLight, AWhiteWallInGlareIsAPictureOrSaysWhatToDo) {
  RoomCapture capture(kViews);
  SetCodes(&capture, 1, [](double code) { return 246 + code / 32; });
  const auto report = Train(capture.Input("work"), capture.Options(40));
  ASSERT_TRUE(report.ok()) << report.status();
  const Look look = LookOf(*report);
  EXPECT_GT(look.mean, 0.2);
  EXPECT_LT(look.mean, 0.98);
}

TEST(ExtremeLight, OneBrightPhotoAmongDarkOnes) {
  RoomCapture capture(kViews);
  capture.SetLight([](int i) { return i == 3 ? Light::kNormal : Light::kLow; });
  const auto report = Train(capture.Input("work"), capture.Options(80));
  ExpectPicture(report);
  EXPECT_THAT(report->notes, Contains(HasSubstr("brightest v003.png")));
}

TEST(ExtremeLight, OneColourIsRefusedByName) {
  RoomCapture capture(kViews);
  SetCodes(&capture, 0, [](double) { return 40; });
  const absl::Status status = Train(capture.Input("work"), capture.Options(10)).status();
  EXPECT_EQ(Reason(status), "TOO_FEW_PHOTOS");
}

// A hundredth of a code, with a band of a fifth: neither flat nor bright enough for a target.
TEST(ExtremeLight, AFaintPhotoIsLeftOutByName) {
  RoomCapture capture(kViews);
  DeepImage deep = Deepen(capture.Photo(3, Light::kNormal));
  const size_t band = deep.codes.size() / 2;
  for (size_t i = 0; i < deep.codes.size(); ++i) {
    deep.codes[i] = i >= band && i < band + deep.codes.size() / 20 ? 50 : 4;
  }
  ASSERT_TRUE(WriteFileAtomically(capture.Path("images/" + RoomCapture::Name(3)),
                                  EncodeTestTiff(deep, {.bits = 16}))
                  .ok());
  for (const Tone rule : {Tone::kCapture, Tone::kPaper}) {
    ReconstructOptions options = capture.Options(10);
    options.recipe->tone.rule = rule;
    const auto report = Train(capture.Input(rule == Tone::kPaper ? "paper" : "work"), options);
    ASSERT_TRUE(report.ok()) << report.status();
    EXPECT_THAT(report->dropped, testing::ElementsAre("v003.png"));
    EXPECT_THAT(report->notes, Contains("v003.png is left out: it is of one colour, (0, 0, 0)"));
  }
}

// 8-bit codes in files of 16 bits.
TEST(ExtremeLight, NumbersOfEightBitsInFilesOfSixteenAreSaid) {
  RoomCapture capture(kViews);
  for (int i = 0; i < kViews; ++i) {
    DeepImage deep = Deepen(capture.Photo(i, Light::kNormal));
    for (uint16_t& code : deep.codes) code /= 257;
    ASSERT_TRUE(WriteFileAtomically(capture.Path("images/" + RoomCapture::Name(i)),
                                    EncodeTestTiff(deep, {.bits = 16}))
                    .ok());
  }
  const auto report = Train(capture.Input("work"), capture.Options(40));
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_THAT(report->notes, Contains(HasSubstr(kNarrow)));
  EXPECT_GT(LookOf(*report).mean, 0.2);
}

// Hundredths of a kelvin.
TEST(ExtremeLight, TemperaturesInFilesOfSixteenBitsAreSaid) {
  Photo photo(4, 1);
  for (size_t i = 0; i < photo.data.size(); ++i) {
    photo.data[i] = PhotoSample(static_cast<float>(28500 + 100 * i) / 65535);
  }
  ImageInfo info;
  info.format = ImageFormat::kTiff;
  info.bit_depth = 16;
  const PhotoDarkness darkness = MeasureDarkness(photo, {}, info);
  std::vector<View> views(1);
  views[0].name = "t.tif";
  std::vector<std::string> notes;
  NoteDarkness(views, {darkness}, &notes);
  EXPECT_THAT(notes, testing::ElementsAre(HasSubstr("of 16 bits, such as t.tif, lie close")));
  // A photo in the dark has values about 0.
  const int16_t least = photo.data[0];
  for (int16_t& sample : photo.data) sample = static_cast<int16_t>(sample - least);
  EXPECT_FALSE(MeasureDarkness(photo, {}, info).close);
}

// The light of the first target where a torch shines, on a tenth of each photo, five stops too
// little; the rest is black. With noise of `sigma` codes.
double LightOfTorch(double sigma, int max_image_side) {
  RoomCapture capture(kViews);
  const auto lit = [](int x, int y) {
    return std::abs(x - RoomCapture::kWidth / 2) < 10 && std::abs(y - RoomCapture::kHeight / 2) < 8;
  };
  for (int i = 0; i < kViews; ++i) {
    ImageU8 photo = capture.Photo(i, Light::kNormal);
    const CounterRng rng(i, 3);
    for (size_t k = 0; k < photo.data.size(); ++k) {
      const auto x = static_cast<int>(k / 3 % photo.width),
                 y = static_cast<int>(k / 3 / photo.width);
      const double code = (lit(x, y) ? Darkened(photo.data[k], 5) : 0) + sigma * rng.Normal(k);
      photo.data[k] = static_cast<uint8_t>(std::max(0.0, std::round(code)));
    }
    capture.SetPhoto(i, photo);
  }
  ReconstructOptions options = capture.Options(10);
  options.max_image_side = max_image_side;
  const Photo target = capture.Load(options).train[0].target;
  double sum = 0;
  for (int y = target.height / 2 - 3; y < target.height / 2 + 3; ++y) {
    for (int x = target.width / 2 - 4; x < target.width / 2 + 4; ++x) {
      for (int c = 0; c < 3; ++c) sum += LinearTable::Get()(target.pixel(x, y)[c]);
    }
  }
  return sum / (6 * 8 * 3);
}

// By what photos are before their shadows' colours are inferred, and before they are shrunk.
TEST(ExtremeLight, NoiseAroundATorchIsNotWhatItIsExposedFor) {
  const double without = LightOfTorch(0, 0);
  EXPECT_NEAR(std::log2(LightOfTorch(1, 0) / without), 0, 1);
  EXPECT_NEAR(std::log2(LightOfTorch(1, RoomCapture::kWidth / 2) / without), 0, 1);
}

}  // namespace
}  // namespace litags
