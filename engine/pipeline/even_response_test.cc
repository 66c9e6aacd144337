#include "engine/pipeline/even_response.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "engine/core/rng.h"
#include "engine/target/capture_light.h"

namespace litags {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr int kSide = 120, kCell = 8, kColumns = kSide / kCell;

// Photos of a wall of coloured cells: photo i is shifted by two columns per photo.
struct Capture {
  std::vector<Photo> photos;
  std::vector<PointSighting> sightings;
  std::vector<Camera> cameras;
};

// Of what a row of cells shows, in even and in odd photos.
double DistanceOf(size_t photo, int row) {
  const double rising = 1 + 3.0 * row / kColumns;
  return photo % 2 == 0 ? rising : 5 - rising;
}

// `light`: per photo; `corner`: stops that the lens takes there; `lamp`: power of the distance.
Capture MakeCapture(const std::vector<std::array<double, 3>>& light, double corner,
                    double lamp = 0) {
  Capture out;
  const CounterRng albedo(3, 4);
  for (const auto& gain : light) {
    const int shift = 2 * static_cast<int>(out.photos.size());
    Photo photo(kSide, kSide);
    for (int y = 0; y < kSide; ++y) {
      for (int x = 0; x < kSide; ++x) {
        const int cell = (x / kCell + shift) * kColumns + y / kCell;
        const double r2 = (std::pow(x + 0.5 - 60, 2) + std::pow(y + 0.5 - 60, 2)) / 7200;
        const double lit = std::pow(2 / DistanceOf(out.photos.size(), y / kCell), lamp);
        for (int c = 0; c < 3; ++c) {
          const double value = 0.02 + 0.2 * albedo.Uniform(3 * cell + c);
          photo.pixel(x, y)[c] = PhotoSample(
              static_cast<float>(SrgbFromLinear(value * lit * gain[c] * std::exp2(-corner * r2))));
        }
      }
    }
    out.photos.push_back(std::move(photo));
    Camera camera;
    camera.width = camera.height = kSide;
    camera.cx = camera.cy = kSide / 2.0;
    out.cameras.push_back(camera);
  }
  const int photos = static_cast<int>(light.size());
  for (int column = 0; column < kColumns + 2 * photos; ++column) {
    for (int row = 0; row < kColumns; ++row) {
      for (int i = 0; i < photos; ++i) {
        const int x = column - 2 * i;
        if (x < 0 || x >= kColumns) continue;
        out.sightings.push_back(
            {column * kColumns + row, i, x * kCell + 4.5, row * kCell + 4.5, DistanceOf(i, row)});
      }
    }
  }
  return out;
}

std::vector<std::string> Even(const ReconstructOptions& options, Capture* capture,
                              Lamp* lamp = nullptr, std::vector<Brightening>* bright = nullptr) {
  const ReconstructInput input;
  const CancelToken never;
  ReconstructReport report;
  std::vector<Brightening> brightened;
  const Lamp found = EvenOutResponse(
      Context(
          input, options, never, [](Stage, const std::string&) {}, &report),
      capture->cameras, {}, /*code_step=*/1, &capture->sightings, &capture->photos, &brightened);
  if (lamp != nullptr) *lamp = found;
  if (bright != nullptr) *bright = brightened;
  return report.notes;
}

double WorstCode(const Capture& a, const Capture& b) {
  double worst = 0;
  for (size_t i = 0; i < a.photos.size(); ++i) {
    for (size_t s = 0; s < a.photos[i].data.size(); ++s)
      worst =
          std::max(worst, std::abs(a.photos[i].data[s] - b.photos[i].data[s]) / kPhotoCode + 0.0);
  }
  return worst;
}

TEST(EvenOutResponse, PhotosOfAnEvenCameraStayWhatTheyAre) {
  Capture capture = MakeCapture(std::vector<std::array<double, 3>>(8, {1, 1, 1}), 0);
  const Capture before = capture;
  Lamp lamp;
  EXPECT_THAT(Even({}, &capture, &lamp), IsEmpty());
  EXPECT_EQ(lamp.power, 0);
  for (size_t i = 0; i < before.photos.size(); ++i)
    EXPECT_EQ(capture.photos[i].data, before.photos[i].data) << i;
}

TEST(EvenOutResponse, TheLensIsTakenOut) {
  const std::vector<std::array<double, 3>> light(8, {1, 1, 1});
  Capture capture = MakeCapture(light, 2.5);
  EXPECT_THAT(Even({}, &capture), ElementsAre(HasSubstr("stops darker")));
  EXPECT_LT(WorstCode(capture, MakeCapture(light, 0)), 8);
}

TEST(EvenOutResponse, TheLensIsTakenOutInLightWithoutBlue) {
  const std::vector<std::array<double, 3>> light(8, {2, 1, 0});
  ReconstructOptions options;
  options.white_balance = WhiteBalance::kCamera;
  Capture capture = MakeCapture(light, 2.5);
  EXPECT_THAT(Even(options, &capture), ElementsAre(HasSubstr("stops darker")));
  EXPECT_LT(WorstCode(capture, MakeCapture(light, 0)), 8);
}

TEST(EvenOutResponse, ALampIsToldAndLeftInThePhotos) {
  const std::vector<std::array<double, 3>> light(8, {1, 1, 1});
  Capture capture = MakeCapture(light, 0, 1.5);
  const Capture before = capture;
  Lamp lamp;
  EXPECT_THAT(Even({}, &capture, &lamp), ElementsAre(HasSubstr("to the power of 1.5")));
  EXPECT_NEAR(lamp.power, 1.5, 0.03);
  EXPECT_EQ(WorstCode(capture, before), 0);
  for (const PointSighting& s : capture.sightings) {
    ASSERT_NEAR(s.lit, std::pow(lamp.distance / s.distance, lamp.power), 1e-5 * s.lit);
  }
}

TEST(EvenOutResponse, OnePhotoOfAnotherWhiteBalanceIsEvenedOut) {
  std::vector<std::array<double, 3>> light(9, {1, 1, 1});
  light[4] = {1.35, 1, 0.75};
  Capture capture = MakeCapture(light, 0);
  EXPECT_THAT(Even({}, &capture), ElementsAre(HasSubstr("white balance differs by up to 3")));
  light[4] = {1, 1, 1};
  EXPECT_LT(WorstCode(capture, MakeCapture(light, 0)), 5);
}

TEST(EvenOutResponse, AStrongCastIsNeutralisedUnlessTheCameraKeepsIt) {
  const std::vector<std::array<double, 3>> sodium(8, {2, 1, 0.07});
  Capture capture = MakeCapture(sodium, 0);
  const Capture before = capture;
  ReconstructOptions options;
  options.white_balance = WhiteBalance::kCamera;
  EXPECT_THAT(Even(options, &capture), IsEmpty());
  EXPECT_EQ(WorstCode(capture, before), 0);
  options.white_balance = WhiteBalance::kScene;
  EXPECT_THAT(Even(options, &capture), ElementsAre(HasSubstr("strong cast")));
  EXPECT_GT(capture.photos[0].pixel(60, 60)[2], 2 * before.photos[0].pixel(60, 60)[2]);
}

TEST(EvenOutResponse, APhotoThatTheCastAloneLightsIsNotMadeBlack) {
  Capture capture = MakeCapture(std::vector<std::array<double, 3>>(8, {2, 1, 0.07}), 0);
  capture.cameras.push_back(capture.cameras[0]);
  Photo& dim = capture.photos.emplace_back(kSide, kSide);
  for (size_t i = 0; i < dim.data.size(); i += 3) dim.data[i] = kBlackSample + 1;
  const Photo before = dim;
  std::vector<Brightening> brightened;
  EXPECT_THAT(Even({}, &capture, nullptr, &brightened), ElementsAre(HasSubstr("strong cast")));
  EXPECT_EQ(capture.photos[8].data, before.data);
  EXPECT_TRUE(brightened[8].none());
  EXPECT_FALSE(brightened[7].none());
}

TEST(EvenOutResponse, OtherTonesTakePhotosAsTheyAre) {
  Capture capture = MakeCapture(std::vector<std::array<double, 3>>(8, {2, 1, 0.07}), 2.5);
  const Capture before = capture;
  ReconstructOptions options;
  options.tone = Tone::kPaper;
  EXPECT_THAT(Even(options, &capture), IsEmpty());
  EXPECT_EQ(WorstCode(capture, before), 0);
}

}  // namespace
}  // namespace litags
