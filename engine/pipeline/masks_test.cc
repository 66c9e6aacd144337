// Photos with masks: what is under one reaches nothing, and the scene is better for it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <string>
#include <vector>

#include "engine/core/error.h"
#include "engine/core/mask.h"
#include "engine/core/rng.h"
#include "engine/io/depth_io.h"
#include "engine/io/file_util.h"
#include "engine/io/mask_io.h"
#include "engine/pipeline/capture_test_util.h"
#include "engine/pipeline/depth_maps.h"
#include "engine/pipeline/reconstruct_test_util.h"

namespace litags {
namespace {

namespace fs = std::filesystem;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr int kViews = 6, kSide = 18;

// Paints a square over photo i, at a place of its own; returns the mask of it.
template <class Paint>
PlaneU8 PaintSquare(int i, const Paint& paint, ImageU8* photo) {
  const CounterRng rng(3, i);
  const int x0 = static_cast<int>(rng.Below(0, photo->width - kSide));
  const int y0 = static_cast<int>(rng.Below(1, photo->height - kSide));
  PlaneU8 mask(photo->width, photo->height);
  std::fill(mask.data.begin(), mask.data.end(), kCounts);
  for (int y = y0; y < y0 + kSide; ++y) {
    for (int x = x0; x < x0 + kSide; ++x) {
      paint(i, x, y, photo->pixel(x, y));
      mask.data[size_t(y) * photo->width + x] = 0;
    }
  }
  return mask;
}

void WriteMask(const std::string& path, const PlaneU8& mask) {
  EXPECT_TRUE(WriteFileAtomically(path, EncodeMask(mask).value()).ok());
}

// The sample room in low light, a square over every photo and a mask of each.
class MaskedRoom {
 public:
  template <class Paint>
  explicit MaskedRoom(const Paint& paint, bool mixed_exposures = false) : room(kViews) {
    fs::create_directory(room.Path("masks"));
    for (int i = 0; i < kViews; ++i) {
      ImageU8 photo = room.Photo(i, mixed_exposures && i % 2 ? Light::kNormal : Light::kLow);
      SetMask(RoomCapture::Name(i) + ".png", PaintSquare(i, paint, &photo));
      room.SetPhoto(i, photo);
    }
  }

  void SetMask(const std::string& name, const PlaneU8& mask) const {
    WriteMask(room.Path("masks") + "/" + name, mask);
  }

  ReconstructInput Input(const std::string& run) const {
    ReconstructInput input = room.Input(run);
    input.masks_dir = room.Path("masks");
    return input;
  }

  RoomCapture room;
};

void PaintBright(int, int, int, uint8_t* pixel) { std::fill_n(pixel, 3, uint8_t{250}); }

void PaintNoise(int photo, int x, int y, uint8_t* pixel) {
  const CounterRng rng(photo, y);
  for (int c = 0; c < 3; ++c) pixel[c] = static_cast<uint8_t>(rng.Below(3 * x + c, 256));
}

// PSNR over some views' pictures in the light of the photos, against the photos without squares.
double PsnrOfViews(const std::string& scene_path, const std::vector<View>& views,
                   const std::vector<ImageU8>& photos) {
  const auto scene = MakeEngine()->LoadScene(scene_path);
  EXPECT_TRUE(scene.ok()) << scene.status();
  double error = 0;
  size_t samples = 0;
  for (size_t i = 0; i < views.size(); ++i) {
    RenderRequest request;
    request.camera = views[i].camera;
    request.channel = Channel::kOriginal;
    const auto picture = (*scene)->Render(request);
    EXPECT_TRUE(picture.ok()) << picture.status();
    const Planes truth = ToPlanes(photos[i]);
    for (size_t k = 0; k < truth.data.size(); ++k) {
      error += std::pow(picture->data[k] - truth.data[k], 2);
    }
    samples += truth.data.size();
  }
  return -10 * std::log10(error / samples);
}

// On a cloud of Gaussians, which the held-out photos show as well as the others: from sixteen small
// views of a room no method learns what two others see.
TEST(Masks, ASquareThatMovesFromPhotoToPhotoIsNotLearnt) {
  const Photographs capture;
  ReconstructOptions options = SmallOptions();
  options.iterations = 400;
  const ReconstructInput plain = capture.Input("plain"), without = capture.Input("without");
  ReconstructInput with = capture.Input("with");
  ASSERT_TRUE(Reconstruct(plain, options).ok());
  with.masks_dir = with.work_dir + "/masks";
  fs::create_directory(with.masks_dir);
  std::vector<View> clean_views;
  std::vector<ImageU8> clean_photos;
  for (int i = 0; i < kPhotos; ++i) {
    const View& view = capture.model.views[i];
    ImageU8 photo = ReadImage(capture.Photo(view.name), "images").value();
    if (i % options.holdout_every == options.holdout_every / 2) {
      clean_views.push_back(view);
      clean_photos.push_back(std::move(photo));
      continue;
    }
    const PlaneU8 mask = PaintSquare(i, PaintBright, &photo);
    ASSERT_TRUE(WritePng(capture.Photo(view.name), photo).ok());
    WriteMask(with.masks_dir + "/" + view.name, mask);
  }
  const auto masked = Reconstruct(with, options), painted = Reconstruct(without, options);
  ASSERT_TRUE(masked.ok()) << masked.status();
  ASSERT_TRUE(painted.ok()) << painted.status();
  const auto psnr = [&](const ReconstructInput& input) {
    return PsnrOfViews(input.work_dir + "/scene.litags", clean_views, clean_photos);
  };
  // Measured: 31.2 dB on the photos without squares, 30.4 dB with masks, 26.6 dB without.
  EXPECT_GT(psnr(with), psnr(without) + 2);
  EXPECT_GT(psnr(with), psnr(plain) - 2);
  EXPECT_THAT(masked->notes, Contains("6 of 8 photos have a mask; 10.5 % of their pixels do not "
                                      "count"));
  EXPECT_THAT(painted->notes, Not(Contains(HasSubstr("mask"))));
}

// Through tone, exposures, weights, structure, lens distortion, stereo and both methods.
TEST(Masks, WhatIsUnderThemChangesNoByteOfTheScene) {
  struct Case {
    const char* name;
    bool distorted, mixed_exposures;
    ReconstructOptions options;
  };
  const RoomCapture any(3);
  std::vector<Case> cases(5, {"capture", false, false, any.Options(40)});
  cases[1].name = "paper";
  cases[1].options.tone = Tone::kPaper;
  cases[2] = {"distorted, stereo", true, false, any.Options(40)};
  cases[2].options.depth_source = DepthOrigin::kStereo;
  cases[3].name = "3dgs";
  cases[3].options.recipe = Plain3dgs();
  cases[4] = {"weights", false, true, any.Options(40)};
  for (const Case& test : cases) {
    SCOPED_TRACE(test.name);
    MaskedRoom bright(PaintBright, test.mixed_exposures), noise(PaintNoise, test.mixed_exposures);
    for (MaskedRoom* capture : {&bright, &noise}) {
      for (Distortion& d : capture->room.model.distortions) d.k1 = test.distorted ? 0.05 : 0;
      capture->room.Input("cameras");  // writes them
    }
    const ReconstructInput a = bright.Input("work"), b = noise.Input("work");
    const auto report = Train(a, test.options);
    ASSERT_TRUE(report.ok()) << report.status();
    const auto other = Train(b, test.options);
    ASSERT_TRUE(other.ok()) << other.status();
    EXPECT_EQ(report->notes, other->notes);
    if (test.mixed_exposures) {
      EXPECT_THAT(report->notes, Contains(HasSubstr("exposures differ")));
    }
    EXPECT_TRUE(SceneBytes(a) == SceneBytes(b));
  }
}

// A photo taken through a pincushion lens ends before the pinhole picture does.
TEST(Masks, WhatALensDoesNotShowDoesNotCount) {
  constexpr char kNote[] = "3 of 3 photos show less than the picture without their lens's";
  for (const double k1 : {0.1, -0.1}) {
    RoomCapture room(3);
    for (Distortion& d : room.model.distortions) d.k1 = k1;
    const auto report = Train(room.Input("trained"), room.Options(1));
    ASSERT_TRUE(report.ok()) << report.status();
    const TrainSet set = room.Load(room.Options(1));
    ASSERT_EQ(set.train.size(), 3u);
    for (const TrainView& v : set.train) {
      const size_t pixels = v.photo.pixels();
      EXPECT_EQ(CountedPixels(v.mask, pixels) < pixels, k1 > 0);
      EXPECT_EQ(Counts(v.mask, 0, 0), k1 < 0);
      EXPECT_TRUE(Counts(v.mask, RoomCapture::kWidth / 2, RoomCapture::kHeight / 2));
    }
    if (k1 > 0) {
      EXPECT_THAT(report->notes, Contains(HasSubstr(kNote)));
    } else {
      EXPECT_THAT(report->notes, Not(Contains(HasSubstr("mask"))));
    }
  }
}

TEST(Masks, AResumedJobEndsWithTheSameBytesAndOtherMasksBeginAnew) {
  const MaskedRoom capture(PaintBright);
  ReconstructOptions options = capture.room.Options(30);
  options.preview_every = options.checkpoint_every = 10;
  const ReconstructInput whole = capture.Input("whole"), parts = capture.Input("parts");
  ASSERT_TRUE(Train(whole, options).ok());
  ASSERT_EQ(Train(parts, options, 12).status().code(), absl::StatusCode::kCancelled);
  const auto resumed = Train(parts, options);
  ASSERT_TRUE(resumed.ok()) << resumed.status();
  EXPECT_THAT(resumed->notes, Contains(HasSubstr("resumed at iteration")));
  EXPECT_TRUE(SceneBytes(parts) == SceneBytes(whole));
  options.threads = 2;
  ASSERT_TRUE(Train(capture.Input("two"), options).ok());
  EXPECT_TRUE(SceneBytes(capture.Input("two")) == SceneBytes(whole));

  PlaneU8 more(RoomCapture::kWidth, RoomCapture::kHeight);
  std::fill_n(more.data.begin(), more.data.size() / 2, kCounts);
  capture.SetMask(RoomCapture::Name(5) + ".png", more);
  const auto anew = Train(parts, options);
  ASSERT_TRUE(anew.ok()) << anew.status();
  EXPECT_THAT(anew->notes, Contains(HasSubstr("a checkpoint of other photos")));
}

TEST(Masks, ThoseThatFitNoPhotoAreRefused) {
  const auto refusal = [](const std::string& name, const PlaneU8& mask) {
    const MaskedRoom capture(PaintBright);
    capture.SetMask(name, mask);
    const absl::Status status = Train(capture.Input("work"), capture.room.Options(1)).status();
    const auto detail = GetErrorDetail(status);
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << status;
    return detail.has_value() ? detail->reason + " " + detail->field : "none";
  };
  PlaneU8 small(RoomCapture::kWidth / 2, RoomCapture::kHeight / 2);
  std::fill(small.data.begin(), small.data.end(), kCounts);
  EXPECT_EQ(refusal("v003.png.png", small), "MASK_SIZE masks[v003.png.png]");
  EXPECT_EQ(refusal("other.png", small), "MASK_WITHOUT_PHOTO masks[other.png]");
  EXPECT_EQ(refusal("v003.png.png", PlaneU8(RoomCapture::kWidth, RoomCapture::kHeight)),
            "MASK_BLACK masks[v003.png.png]");
}

// Photos of 128x96 px, trained at 64x48.
TEST(Masks, ShrinkWithTheirPhotos) {
  const Photographs capture(2 * kWidth, 2 * kHeight);
  ReconstructOptions options = SmallOptions();
  options.max_image_side = kWidth;
  ReconstructInput bright = capture.Input("bright"), noise = capture.Input("noise");
  bright.masks_dir = noise.masks_dir = bright.work_dir + "/masks";
  fs::create_directory(bright.masks_dir);
  const std::string name = capture.model.views[1].name;
  const ImageU8 photo = ReadImage(capture.Photo(name), "images").value();
  ImageU8 painted = photo;
  WriteMask(bright.masks_dir + "/" + name, PaintSquare(0, PaintBright, &painted));
  ASSERT_TRUE(WritePng(capture.Photo(name), painted).ok());
  ASSERT_TRUE(Reconstruct(bright, options).ok());
  painted = photo;
  PaintSquare(0, PaintNoise, &painted);
  ASSERT_TRUE(WritePng(capture.Photo(name), painted).ok());
  const auto report = Reconstruct(noise, options);
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_TRUE(SceneBytes(bright) == SceneBytes(noise));

  // Something counts in the photo as it was taken, nothing at half its size.
  PlaneU8 comb(2 * kWidth, 2 * kHeight);
  for (size_t i = 0; i < comb.data.size(); i += 2) comb.data[i] = kCounts;
  WriteMask(bright.masks_dir + "/" + name, comb);
  const absl::Status status = Reconstruct(bright, options).status();
  EXPECT_THAT(std::string(status.message()),
              HasSubstr("masks[" + name + "]: at 64x48 px, the size of training"));
}

TEST(Masks, MaskedPixelsHaveNoDepth) {
  const RoomCapture room(3);
  ReconstructInput input = room.Input("work");
  input.depth_dir = input.work_dir;
  Planes ramp(1, RoomCapture::kHeight, RoomCapture::kWidth);
  for (size_t i = 0; i < ramp.data.size(); ++i) ramp.data[i] = 1 + i % 7;
  ASSERT_TRUE(WriteFileAtomically(input.depth_dir + "/v000.pfm", EncodePfm(ramp)).ok());
  const Photo photo = PhotoFromU8(room.Photo(0, Light::kLow));
  PlaneU8 mask(RoomCapture::kWidth, RoomCapture::kHeight);
  std::fill(mask.data.begin() + 100, mask.data.end(), kCounts);
  ReconstructReport report;
  const ReconstructOptions options = room.Options(1);
  const CancelToken never;
  const auto silent = [](Stage, const std::string&) {};
  const auto maps =
      MakeDepthMaps(Context(input, options, never, silent, &report),
                    {{&room.model.views[0], &photo, &photo, nullptr, &mask}}, {}, {}, "key");
  ASSERT_TRUE(maps.ok()) << maps.status();
  ASSERT_TRUE(maps->at(0).has_value());
  const DepthMap& depth = *maps->at(0);
  for (size_t i = 0; i < ramp.data.size(); ++i) {
    ASSERT_EQ(depth.confidence.data[i], i < 100 ? 0 : 1) << i;
    ASSERT_EQ(depth.depth.data[i], i < 100 ? 0 : ramp.data[i]) << i;
  }
}

}  // namespace
}  // namespace litags
