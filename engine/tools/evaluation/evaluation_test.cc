#include "engine/tools/evaluation/evaluation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <numeric>

#include "engine/core/color.h"
#include "engine/core/error.h"
#include "engine/core/error_test_util.h"
#include "engine/core/mask.h"
#include "engine/core/temp_dir_test_util.h"
#include "engine/eval/metrics.h"
#include "engine/io/colmap_io.h"
#include "engine/io/depth_io.h"
#include "engine/io/exif_test_util.h"
#include "engine/io/file_util.h"
#include "engine/io/image_io.h"
#include "engine/io/test_util.h"
#include "engine/io/transforms_io.h"
#include "engine/pipeline/capture_targets.h"
#include "engine/tools/evaluation/benchmark_scene.h"
#include "engine/tools/evaluation/distort_test_util.h"

namespace litags {
namespace {

ImageU8 Ramp(int offset) {
  ImageU8 image(32, 24);
  for (size_t i = 0; i < image.data.size(); ++i) {
    image.data[i] = static_cast<uint8_t>(40 + offset + (i * 7) % 100);
  }
  return image;
}

// A view whose photos are taken as they are.
TestView Named(const std::string& name) { return {.view = {name, Camera()}, .distortion = {}}; }

// Writes SCENE/transforms_NAME.json with cameras of these names.
void WriteCameras(const std::string& scene, const std::string& name,
                  const std::vector<std::string>& photos) {
  Camera camera;
  camera.width = 96;
  camera.height = 64;
  camera.fx = camera.fy = 80;
  SparseModel model;
  for (const std::string& photo : photos) model.views.push_back({photo, camera});
  model.distortions.resize(photos.size());
  ASSERT_TRUE(WriteTransforms(scene + "/transforms_" + name + ".json", model, "high").ok());
}

class EvaluationTest : public testing::Test {
 protected:
  void SetUp() override {
    std::filesystem::create_directories(dir_ + "/truth");
    std::filesystem::create_directories(dir_ + "/photos");
  }
  const TempDir temporary_;
  const std::string dir_ = temporary_.path();
};

TEST_F(EvaluationTest, AUniformOffsetCostsItsPsnrAndNothingAfterTheColourFit) {
  ASSERT_TRUE(WritePng(dir_ + "/truth/a.png", Ramp(0)).ok());
  Scorer scorer(dir_ + "/truth");
  ASSERT_TRUE(scorer.Add(Named("a.png"), Ramp(10)).ok());
  ASSERT_TRUE(scorer.Add(Named("no-truth.png"), Ramp(90)).ok());
  const absl::StatusOr<Scores> scores = scorer.Finish();
  ASSERT_TRUE(scores.ok()) << scores.status();
  ASSERT_EQ(scores->views.size(), 1u);
  EXPECT_EQ(scores->views[0].name, "a.png");
  EXPECT_NEAR(scores->psnr, -20 * std::log10(10.0 / 255), 1e-6);
  EXPECT_GT(scores->psnr_affine, 80);
}

// The picture without the lens's distortion shows more than the photo.
TEST_F(EvaluationTest, WhatThePhotoDoesNotShowIsNotScored) {
  ASSERT_TRUE(WritePng(dir_ + "/truth/a.png", Ramp(0)).ok());
  TestView view = Named("a.png");
  Camera& camera = view.view.camera;
  camera = {.width = 32, .height = 24, .fx = 30, .fy = 30, .cx = 16, .cy = 12};
  view.distortion.k1 = 0.5;
  const PlaneU8 shown = MaskOfUndistorted(camera, view.distortion).value();
  ImageU8 right = LoadPicture(dir_ + "/truth", view).value(), off = right, other_rim = right;
  ForMasked(shown, [&](size_t i) { other_rim.data[3 * i] ^= 0xff; });
  for (uint8_t& code : off.data) code += 10;
  ForMasked(shown, [&](size_t i) { off.data[3 * i] ^= 0xff; });
  const auto score = [&](const ImageU8& picture) {
    Scorer scorer(dir_ + "/truth");
    EXPECT_TRUE(scorer.Add(view, picture).ok());
    return scorer.Finish().value();
  };
  EXPECT_LT(CountedPixels(shown, right.pixels()), 0.95 * static_cast<double>(right.pixels()));
  EXPECT_TRUE(std::isinf(score(other_rim).psnr));
  const Scores scores = score(off);
  EXPECT_NEAR(scores.psnr, -20 * std::log10(10.0 / 255), 1e-6);
  EXPECT_GT(scores.psnr_affine, 80);
  EXPECT_EQ(scores.ssim, Ssim(off, right, SsimBorder::kValid, shown).value());
}

// By the light, as training shrinks photos: half black, half white is code 188.
TEST_F(EvaluationTest, TheTruthOfAnotherSizeIsAveragedInLinearLight) {
  ImageU8 checkers(64, 48), gray(32, 24);
  for (int y = 0; y < 48; ++y) {
    for (int x = 0; x < 64; ++x) std::fill_n(checkers.pixel(x, y), 3, (x + y) % 2 == 0 ? 0 : 255);
  }
  std::fill(gray.data.begin(), gray.data.end(), 188);
  ASSERT_TRUE(WritePng(dir_ + "/truth/a.png", checkers).ok());
  Scorer scorer(dir_ + "/truth");
  ASSERT_TRUE(scorer.Add(Named("a.png"), gray).ok());
  EXPECT_TRUE(std::isinf(scorer.Finish()->psnr));
}

TEST_F(EvaluationTest, PicturesBelowTheWindowOfSsimAreScoredWithoutIt) {
  ImageU8 small(32, 10);
  std::iota(small.data.begin(), small.data.end(), uint8_t{0});
  ASSERT_TRUE(WritePng(dir_ + "/truth/small.png", small).ok());
  Scorer scorer(dir_ + "/truth");
  ASSERT_TRUE(scorer.Add(Named("small.png"), small).ok());
  absl::StatusOr<Scores> scores = scorer.Finish();
  ASSERT_TRUE(scores.ok()) << scores.status();
  EXPECT_TRUE(std::isnan(scores->ssim));
  EXPECT_NE(scores->ToJson().find("\"ssim\": null"), std::string::npos);
  ASSERT_TRUE(WritePng(dir_ + "/truth/large.png", Ramp(0)).ok());
  ASSERT_TRUE(scorer.Add(Named("large.png"), Ramp(0)).ok());
  scores = scorer.Finish();
  ASSERT_TRUE(scores.ok()) << scores.status();
  EXPECT_NEAR(scores->ssim, 1, 1e-9);
}

TEST_F(EvaluationTest, NoTruthPhotoIsNotFound) {
  Scorer scorer(dir_ + "/truth");
  ASSERT_TRUE(scorer.Add(Named("a.png"), Ramp(0)).ok());
  const absl::Status status = scorer.Finish().status();
  EXPECT_TRUE(absl::IsNotFound(status));
  EXPECT_EQ(GetErrorDetail(status)->reason, "NO_TRUTH");
}

TEST_F(EvaluationTest, CamerasTakeTheSizeOfThePhotosInAFolder) {
  ASSERT_TRUE(WritePng(dir_ + "/photos/a.png", Ramp(0)).ok());  // 32x24
  TestView view = Named("a.jpg");
  view.view.camera.width = 64;
  view.view.camera.height = 48;
  view.view.camera.fx = view.view.camera.fy = 50;
  view.view.camera.cx = 32;
  view.view.camera.cy = 20;
  const auto sized = AtSizeOfPhotos({view}, dir_ + "/photos");
  ASSERT_TRUE(sized.ok()) << sized.status();
  const Camera& camera = sized->at(0).view.camera;
  EXPECT_EQ(camera.width, 32);
  EXPECT_EQ(camera.height, 24);
  EXPECT_EQ(camera.fx, 25);
  EXPECT_EQ(camera.cy, 10);
  EXPECT_TRUE(absl::IsNotFound(AtSizeOfPhotos({Named("b.png")}, dir_ + "/photos").status()));
}

TEST_F(EvaluationTest, LargeTruthIsAveragedDownToTheSizeThatIsTrained) {
  TestView view = Named("a.png");
  view.view.camera.width = 32;
  view.view.camera.height = 24;
  view.view.camera.fx = view.view.camera.fy = 40;
  view.view.camera.cx = 16;
  EXPECT_EQ(AtMost(0, {view})[0].view.camera.width, 32);
  EXPECT_EQ(AtMost(32, {view})[0].view.camera.width, 32);
  const TestView half = AtMost(16, {view})[0];
  EXPECT_EQ(half.view.camera.width, 16);
  EXPECT_EQ(half.view.camera.height, 12);
  EXPECT_EQ(half.view.camera.fx, 20);
  EXPECT_EQ(half.view.camera.cx, 8);

  // Codes 40, 80 / 120, 160 again and again, whose light is averaged.
  ImageU8 truth(32, 24), mean(16, 12);
  for (int y = 0; y < 24; ++y) {
    for (int x = 0; x < 32; ++x) {
      std::fill_n(truth.pixel(x, y), 3, static_cast<uint8_t>(40 + 40 * (x % 2) + 80 * (y % 2)));
    }
  }
  double light = 0;
  for (const int code : {40, 80, 120, 160}) light += LinearFromSrgb(code / 255.0) / 4;
  std::fill(mean.data.begin(), mean.data.end(),
            static_cast<uint8_t>(std::lround(255 * SrgbFromLinear(light))));
  ASSERT_TRUE(WritePng(dir_ + "/truth/a.png", truth).ok());
  Scorer scorer(dir_ + "/truth");
  ASSERT_TRUE(scorer.Add(half, mean).ok());
  EXPECT_TRUE(std::isinf(scorer.Finish()->psnr));
}

TEST_F(EvaluationTest, PosesTakeTheTestViewsPlaceAndNeedKnownCameras) {
  WriteCameras(dir_, "train", {"a.JPG", "b.JPG"});
  WriteCameras(dir_, "mine", {"a.JPG", "x.JPG"});
  BenchmarkScene scene{.dir = dir_ + "/photos", .light = "", .cameras = ""};
  scene.poses = dir_ + "/transforms_mine.json";
  ReconstructOptions options;
  const auto reason = [&] {
    const auto detail = GetErrorDetail(scene.Input("work", &options).status());
    return detail.has_value() ? detail->reason : "OK";
  };
  EXPECT_EQ(reason(), "POSES_WITHOUT_CAMERAS");
  scene.cameras = dir_ + "/transforms_train.json";
  EXPECT_EQ(reason(), "OK");
  EXPECT_EQ(options.holdout_every, 0);
  EXPECT_EQ(scene.TestViews()->at(1).view.name, "x.JPG");
  // What is scored must not be trained on.
  scene.truth = dir_ + "/truth";
  EXPECT_EQ(reason(), "TEST_VIEW_IN_CAMERAS");
  // Cameras are read as training reads them: in a folder, and of panoramas.
  auto cameras = nlohmann::json::parse(ReadFile(scene.cameras, "", 1 << 20).value());
  cameras["frames"].erase(0);
  cameras["camera_model"] = "EQUIRECTANGULAR";
  ASSERT_TRUE(WriteFileAtomically(dir_ + "/transforms.json", cameras.dump()).ok());
  scene.cameras = dir_;
  EXPECT_EQ(reason(), "OK");
  scene.sfm = true;
  EXPECT_EQ(reason(), "POSES_WITHOUT_CAMERAS");
}

TEST_F(EvaluationTest, PhotosAreScoredAfterTheToneRule) {
  ASSERT_TRUE(WritePng(dir_ + "/photos/a.png", Ramp(-30)).ok());
  const TestView view = Named("a.png");
  ReconstructOptions options;
  const ImageU8 target = MakePseudoTargets({PhotoFromU8(Ramp(-30))}, options).value()[0];
  ASSERT_TRUE(WritePng(dir_ + "/truth/a.png", target).ok());
  std::vector<std::string> black;
  const auto score = [&](const std::vector<TestView>& views) {
    return ScorePhotos(dir_ + "/photos", views, dir_ + "/truth", options, &black);
  };
  EXPECT_TRUE(std::isinf(score({view})->psnr));
  EXPECT_THAT(black, testing::IsEmpty());
  ASSERT_TRUE(WritePng(dir_ + "/photos/b.png", ImageU8(32, 24)).ok());
  ASSERT_TRUE(WritePng(dir_ + "/truth/b.png", target).ok());
  const auto with_black = score({view, Named("b.png")});
  ASSERT_TRUE(with_black.ok()) << with_black.status();
  EXPECT_EQ(with_black->views.size(), 1u);
  EXPECT_THAT(black, testing::ElementsAre("b.png"));
  EXPECT_TRUE(absl::IsNotFound(score({Named("b.png")}).status()));  // nothing is left
  options.tone = Tone::kNone;
  EXPECT_LT(score({view})->psnr, 30);
}

// Of 16 bits, with light below half a code of 8: training takes it.
TEST_F(EvaluationTest, APhotoBelowHalfACodeIsBrightened) {
  Photo faint(32, 24);
  for (size_t i = 0; i < faint.data.size(); ++i) {
    faint.data[i] = static_cast<int16_t>((i % 5 == 0 ? 0.4f : 0.1f) * kPhotoCode);
  }
  ASSERT_TRUE(WriteFileAtomically(dir_ + "/photos/a.png", EncodePng16(faint, 16).value()).ok());
  ASSERT_TRUE(WritePng(dir_ + "/truth/a.png", Ramp(0)).ok());
  ReconstructOptions options;
  options.tone = Tone::kCapture;
  std::vector<std::string> black;
  const auto score = [&] {
    return ScorePhotos(dir_ + "/photos", {Named("a.png")}, dir_ + "/truth", options, &black);
  };
  EXPECT_TRUE(score().ok());
  EXPECT_THAT(black, testing::IsEmpty());
  options.tone = Tone::kPaper;  // its targets are of 8-bit codes
  EXPECT_TRUE(absl::IsNotFound(score().status()));
  EXPECT_THAT(black, testing::ElementsAre("a.png"));
}

// Sees the same distance and colour everywhere.
class FlatScene : public Scene {
 public:
  explicit FlatScene(float depth, std::vector<View> views = {})
      : depth_(depth), views_(std::move(views)) {}
  const std::vector<View>& views() const override { return views_; }
  int64_t num_gaussians() const override { return 0; }
  int iteration() const override { return 0; }
  std::array<double, 3> center() const override { return {}; }
  std::array<double, 3> up() const override { return {0, 1, 0}; }
  double radius() const override { return 1; }
  absl::StatusOr<Planes> Render(const RenderRequest& request) const override {
    const int channels = request.channel == Channel::kDepth ? 1 : 3;
    Planes planes(channels, request.camera.height, request.camera.width);
    std::fill(planes.data.begin(), planes.data.end(), depth_);
    return planes;
  }
  absl::StatusOr<int64_t> Export(const std::string&, const ExportRequest&) const override {
    return 0;
  }
  absl::Status ExportFullPly(const std::string&) const override { return absl::OkStatus(); }
  absl::Status Save(const std::string&) const override { return absl::OkStatus(); }

 private:
  float depth_;
  std::vector<View> views_;
};

TEST_F(EvaluationTest, PhotosOfOneStemHavePicturesOfTheirOwn) {
  EXPECT_THAT(PictureStems({"a.jpg", "a.png", "b.png", "c"}),
              testing::ElementsAre("a.jpg", "a.png", "b", "c"));
  EXPECT_THAT(PictureStems({"a.jpg", "a.png", "a.png.jpg"}),
              testing::ElementsAre("a.jpg", "a.png", "a.png.jpg"));
  std::vector<TestView> views;
  for (const char* name : {"a.jpg", "a.png", "b.png"}) {
    ASSERT_TRUE(WritePng(dir_ + "/truth/" + name, Ramp(0)).ok());
    views.push_back(Named(name));
    views.back().view.camera = {.width = 32, .height = 24, .fx = 30, .fy = 30, .cx = 16, .cy = 12};
  }
  const std::string pictures = dir_ + "/pictures";
  const auto scores = ScoreScene(FlatScene(0.5), views, dir_ + "/truth", pictures, 1);
  ASSERT_TRUE(scores.ok()) << scores.status();
  EXPECT_EQ(scores->views.size(), 3u);
  for (const char* name : {"a.jpg.png", "a.png.png", "b.png"}) {
    EXPECT_TRUE(std::filesystem::exists(pictures + "/" + name)) << name;
  }
}

TEST_F(EvaluationTest, DepthIsComparedWhereTheTruthIsKnown) {
  TestView view = Named("a.png"), bent = Named("b.png"), other = Named("c.png");
  view.view.camera.width = bent.view.camera.width = other.view.camera.width = 5;
  view.view.camera.height = bent.view.camera.height = other.view.camera.height = 2;
  bent.distortion.k1 = 0.1;
  Planes truth(1, 2, 5);
  // Exact, 1 % and 5 % off, too far by a quarter, too near by a third; half of it is unknown.
  truth.data = {3, 3.03f, 3.15f, 2.4f, 4.5f, 0, 0, 0, 0, 0};
  for (const char* name : {"a", "b"}) {
    ASSERT_TRUE(WritePfm(dir_ + "/" + name + ".pfm", truth).ok());
  }
  const auto scores = ScoreDepth(FlatScene(3), {view, bent, other}, dir_, 1);
  ASSERT_TRUE(scores.ok() && scores->has_value()) << scores.status();
  EXPECT_EQ((*scores)->views, 1);
  EXPECT_DOUBLE_EQ((*scores)->within_2_percent, 0.4);
  EXPECT_DOUBLE_EQ((*scores)->within_10_percent, 0.6);
  EXPECT_DOUBLE_EQ((*scores)->beyond_20_percent, 0.2);
  EXPECT_FALSE(ScoreDepth(FlatScene(3), {bent, other}, dir_, 1)->has_value());
  view.view.camera.width = 4;
  EXPECT_EQ(GetErrorDetail(ScoreDepth(FlatScene(3), {view}, dir_, 1).status())->reason,
            "SIZE_MISMATCH");
}

TEST_F(EvaluationTest, TruthPhotosAreUndistortedAndFoundByStem) {
  Camera camera;
  camera.width = 96;
  camera.height = 64;
  camera.fx = camera.fy = 80;
  camera.cx = 48;
  camera.cy = 32;
  const Distortion lens{.k1 = -0.25, .k2 = 0.02, .p1 = 0.004, .p2 = -0.003};
  ImageU8 pinhole(96, 64);
  for (int y = 0; y < 64; ++y) {
    for (int x = 0; x < 96; ++x) {
      const double v = 128 + 60 * std::sin(0.4 * x) * std::cos(0.35 * y);
      std::fill_n(pinhole.pixel(x, y), 3, static_cast<uint8_t>(v));
    }
  }
  std::filesystem::create_directories(dir_ + "/scene/high");
  const ImageU8 taken = DistortPicture(pinhole, camera, lens);
  ASSERT_TRUE(WritePng(dir_ + "/scene/high/a.png", taken).ok());
  // The file is of another resolution, as transforms.json of a photo that was shrunk later.
  SparseModel model;
  model.views = {{"a.JPG", camera.Scaled(192, 128)}};
  model.distortions = {lens};
  ASSERT_TRUE(WriteTransforms(dir_ + "/scene/transforms_test.json", model, "high").ok());

  const BenchmarkScene scene{.dir = dir_ + "/scene", .light = "low", .cameras = ""};
  const auto views = scene.TestViews();
  ASSERT_TRUE(views.ok()) << views.status();
  ASSERT_EQ(views->size(), 1u);
  EXPECT_EQ(views->at(0).view.camera.width, 96);
  EXPECT_NEAR(views->at(0).view.camera.fx, 80, 1e-9);
  Scorer scorer(scene.TruthDir());
  ASSERT_TRUE(scorer.Add(views->at(0), pinhole).ok());
  const double undistorted = scorer.Finish()->psnr,
               as_taken = 10 * std::log10(65025 / [&] {
                            double sum = 0;
                            for (size_t i = 0; i < taken.data.size(); ++i) {
                              sum += std::pow(double(taken.data[i]) - pinhole.data[i], 2) /
                                     taken.data.size();
                            }
                            return sum;
                          }());
  EXPECT_LT(as_taken, 22);
  EXPECT_GT(undistorted, 30);  // interpolated twice
}

TEST_F(EvaluationTest, SceneWithTestViewsHoldsOutNothingElseAndTrainsOnNoneOfThem) {
  WriteCameras(dir_, "train", {"a.JPG", "b.JPG"});
  WriteCameras(dir_, "test", {"c.JPG"});
  WriteCameras(dir_, "fewer", {"b.JPG"});
  WriteCameras(dir_, "all", {"a.JPG", "b.JPG", "c.JPG"});
  BenchmarkScene scene{.dir = dir_, .light = "low", .cameras = ""};
  for (const char* cameras : {"", "fewer"}) {
    if (*cameras != 0) scene.cameras = dir_ + "/transforms_" + cameras + ".json";
    ReconstructOptions options;
    ASSERT_TRUE(scene.Input("work", &options).ok());
    EXPECT_EQ(options.holdout_every, 0);
  }
  scene.cameras = dir_ + "/transforms_all.json";
  ReconstructOptions options;
  const absl::Status status = scene.Input("work", &options).status();
  ASSERT_TRUE(GetErrorDetail(status).has_value()) << status;
  EXPECT_EQ(GetErrorDetail(status)->reason, "TEST_VIEW_IN_CAMERAS");
  EXPECT_THAT(std::string(status.message()), testing::HasSubstr("c.JPG"));
}

// COLMAP would find cameras in a world of its own, and train on the test views.
TEST_F(EvaluationTest, TestViewsNeedKnownCamerasOrThoseOfColmap) {
  WriteCameras(dir_, "test", {"c.JPG"});
  BenchmarkScene scene{.dir = dir_, .light = "low", .cameras = ""};
  ReconstructOptions options;
  const absl::Status status = scene.Input("work", &options).status();
  EXPECT_EQ(Reason(status), "POSES_WITHOUT_CAMERAS");
  EXPECT_THAT(std::string(status.message()), testing::HasSubstr("--cameras"));
  scene.sfm = true;
  EXPECT_TRUE(scene.Input("work", &options).ok());
}

// COLMAP ignores EXIF; training turns its cameras, too.
TEST_F(EvaluationTest, CamerasOfStoredTruthPhotosAreTurnedUprightWithThem) {
  std::filesystem::create_directories(dir_ + "/high");
  const std::string jpeg = EncodeJpeg(TestImage(96, 64)).value();
  ASSERT_TRUE(
      WriteFileAtomically(dir_ + "/high/a.jpg", WithJpegExif(jpeg, ExifBlock(6, true))).ok());
  SparseModel model;
  Camera camera = {.width = 96, .height = 64, .fx = 80, .fy = 70, .cx = 50, .cy = 30};
  model.views = {{"a.jpg", camera}};
  model.distortions.resize(1);
  const auto views = [&] {
    EXPECT_TRUE(WriteTransforms(dir_ + "/transforms_test.json", model, "high").ok());
    return BenchmarkScene{.dir = dir_, .light = "low", .cameras = ""}.TestViews();
  };
  const auto turned = views();
  ASSERT_TRUE(turned.ok()) << turned.status();
  const Camera& upright = turned->at(0).view.camera;
  EXPECT_EQ(upright.width, 64);
  EXPECT_EQ(upright.height, 96);
  EXPECT_EQ(upright.fx, 70);
  EXPECT_EQ(upright.fy, 80);
  EXPECT_EQ(upright.cx, 64 - 30);
  EXPECT_EQ(upright.cy, 50);
  EXPECT_NEAR(upright.R[1], -1, 1e-9);
  EXPECT_NEAR(upright.R[3], 1, 1e-9);
  model.views[0].camera.width = 64;  // a square is squeezed into neither
  EXPECT_EQ(Reason(views().status()), "CAMERA_SIZE_MISMATCH");
}

TEST_F(EvaluationTest, ATestViewIsKnownWithoutItsExtension) {
  WriteCameras(dir_, "test", {"c"});
  WriteCameras(dir_, "all", {"a.JPG", "c.JPG"});
  const BenchmarkScene scene{.dir = dir_, .light = "low", .cameras = dir_ + "/transforms_all.json"};
  ReconstructOptions options;
  EXPECT_EQ(GetErrorDetail(scene.Input("work", &options).status())->reason, "TEST_VIEW_IN_CAMERAS");
}

TEST_F(EvaluationTest, CamerasWithoutASizeHaveThatOfThePhotos) {
  for (const char* name : {"train", "test"}) {
    WriteCameras(dir_, name, {std::string(name) + ".png"});
    const std::string path = dir_ + "/transforms_" + name + ".json";
    auto cameras = nlohmann::json::parse(ReadFile(path, "", 1 << 20).value());
    cameras.erase("w");
    cameras.erase("h");
    ASSERT_TRUE(WriteFileAtomically(path, cameras.dump()).ok());
  }
  std::filesystem::create_directories(dir_ + "/low");
  ASSERT_TRUE(WritePng(dir_ + "/low/train.png", Ramp(0)).ok());
  const BenchmarkScene scene{.dir = dir_, .light = "low", .cameras = ""};
  ReconstructOptions options;
  const auto input = scene.Input("work", &options);
  ASSERT_TRUE(input.ok()) << input.status();
  EXPECT_EQ(scene.TestViews()->at(0).view.camera.width, 32);
  // Of its own photo, where that is there.
  std::filesystem::create_directories(dir_ + "/high");
  ASSERT_TRUE(WritePng(dir_ + "/high/a.png", Ramp(0)).ok());
  ASSERT_TRUE(WritePng(dir_ + "/high/test.png", ImageU8(48, 64)).ok());
  const auto views = scene.TestViews();
  ASSERT_TRUE(views.ok()) << views.status();
  EXPECT_EQ(views->at(0).view.camera.height, 64);
}

// COLMAP's cameras, and the lenses that it found; of photos that the run did not train on.
TEST_F(EvaluationTest, TestViewsOfAColmapRunAreTheScenesWithTheirLens) {
  WriteCameras(dir_, "test", {"b.png", "c.png", "z.png"});
  SparseModel found;
  Camera camera;
  camera.width = 96;
  camera.height = 64;
  camera.fx = camera.fy = 77;
  found.views = {{"a.png", camera}, {"b.png", camera}, {"c.png", camera}, {"d.png", camera}};
  found.distortions = {Distortion(), {.k1 = -0.1}, Distortion(), Distortion()};
  std::filesystem::create_directories(dir_ + "/work/cameras");
  ASSERT_TRUE(WriteColmapModel(dir_ + "/work/cameras", found).ok());
  BenchmarkScene scene{.dir = dir_, .light = "low", .cameras = ""};
  scene.sfm = true;
  UnscoredViews unscored;
  const FlatScene trained(1, found.views);
  const auto views = scene.TestViews(trained, dir_ + "/work", /*holdout_every=*/2, &unscored);
  ASSERT_TRUE(views.ok()) << views.status();
  EXPECT_THAT(unscored.Notes(views->size()),
              testing::ElementsAre("test views that were trained on are not scored: c.png",
                                   "1 of 3 test views have no camera in this scene and are not "
                                   "scored: z.png"));
  EXPECT_TRUE(scene.TestViews(trained, dir_ + "/work", /*holdout_every=*/8, &unscored)->empty());
  EXPECT_EQ(unscored.Notes(0).back(), "no test view is left: nothing is scored");
  EXPECT_THAT(UnscoredViews().Notes(0), testing::IsEmpty());
  ASSERT_EQ(views->size(), 1u);
  EXPECT_EQ(views->at(0).view.name, "b.png");
  EXPECT_EQ(views->at(0).view.camera.fx, 77);
  EXPECT_EQ(views->at(0).distortion.k1, -0.1);
}

}  // namespace
}  // namespace litags
