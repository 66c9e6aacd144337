#include "engine/pipeline/export_scene.h"

#include <cmath>
#include <limits>
#include <vector>

#include "engine/core/color.h"
#include "engine/core/error_test_util.h"
#include "engine/core/temp_dir_test_util.h"
#include "engine/export/export_test_util.h"
#include "engine/export/formats.h"
#include "engine/export/near_order.h"
#include "engine/export/readers.h"
#include "engine/io/test_util.h"
#include "engine/pipeline/model_scene.h"
#include "engine/pipeline/render_rules.h"
#include "engine/pipeline/scene_test_util.h"
#include "engine/viewer/viewer.h"
#include "gtest/gtest.h"

namespace litags {
namespace {

absl::StatusOr<ViewerScene> Made(const Model& model, const ExportRequest& request) {
  return MakeViewerScene(model, RingViews(5), {0, -1, 0}, request);
}

TEST(ExportScene, EveryFormatIsWrittenAndHoldsTheGaussiansWithUpWhereTheFormatHasIt) {
  const TempDir dir;
  const auto scene = MakeScene(SmallModel(), RingViews(5));
  ExportRequest request;
  const auto plain = Made(SmallModel(), request);
  ASSERT_TRUE(plain.ok()) << plain.status();
  const std::array<double, 3> up = scene->up();
  for (const FormatInfo& info : Formats()) {
    SCOPED_TRACE(info.name);
    if (info.format == SceneFormat::kHtml && ViewerModule().empty()) continue;
    request.format = info.format;
    const std::string path = dir / (std::string("a") + info.ending);
    const auto count = scene->Export(path, request);
    ASSERT_TRUE(count.ok()) << count.status();
    EXPECT_EQ(*count, 37);
    if (info.format == SceneFormat::kColmap) {
      const auto model = ReadExportedColmap(Bytes(path));
      ASSERT_TRUE(model.ok()) << model.status();
      EXPECT_EQ(model->points.size(), 37u);
      EXPECT_EQ(model->views.size(), 5u);
      continue;
    }
    const auto read = ReadExported(info.format, Bytes(path));
    ASSERT_TRUE(read.ok()) << read.status();
    ASSERT_EQ(read->splats.size(), 37u);
    if (info.format == SceneFormat::kSplat) continue;  // in another order
    const bool near_order =
        info.format == SceneFormat::kCompressedPly || info.format == SceneFormat::kHtml;
    const std::vector<uint32_t> order = NearOrder(plain->splats);
    for (size_t i = 0; i < 37; ++i) {
      const size_t from = near_order ? order[i] : i;
      double height = 0;
      for (int k = 0; k < 3; ++k) height += up[k] * plain->splats.at(from, kMean + k);
      if (info.up == UpAxis::kY) {
        EXPECT_NEAR(read->splats.at(i, kMean + 1), height, 1e-3);
      } else {
        EXPECT_NEAR(read->splats.at(i, kMean), plain->splats.at(from, kMean), 2e-3);
      }
    }
  }
}

TEST(ExportScene, ExposureIsBakedIntoColours) {
  Model model = SmallModel();
  model.curve.reset();
  ExportRequest request;
  const auto before = Made(model, request);
  request.exposure_stops = -1.5;
  const auto after = Made(model, request);
  ASSERT_TRUE(before.ok() && after.ok());
  for (size_t i = 0; i < 37; ++i) {
    for (int c = 0; c < 3; ++c) {
      const double code = 0.5 + kSh0 * before->splats.at(i, kShDc + c);
      const double want = SrgbFromLinear(std::exp2(-1.5) * LinearFromSrgb(code));
      EXPECT_NEAR(0.5 + kSh0 * after->splats.at(i, kShDc + c), want, 1e-5);
    }
  }
}

TEST(ExportScene, CropAndPruneAndScaleCanBeTogether) {
  ExportRequest request;
  request.crop = Box{{-1, -1, -0.5}, {1, 1, 1}};
  const auto cropped = Made(SmallModel(), request);
  ASSERT_TRUE(cropped.ok()) << cropped.status();
  EXPECT_LT(cropped->splats.size(), 37u);
  request.max_splats = 10;
  request.scale = 100;
  const auto pruned = Made(SmallModel(), request);
  ASSERT_TRUE(pruned.ok()) << pruned.status();
  ASSERT_EQ(pruned->splats.size(), 10u);
  for (size_t i = 0; i < 10; ++i) EXPECT_GE(pruned->splats.at(i, kMean + 2), -50.001f);
}

// Photos of 1600 px, at 1000 px per unit of X/Z, from a distance of a unit.
std::vector<View> LargeViews() {
  View view{"photo.png", {}};
  Camera& c = view.camera;
  c.width = 1600;
  c.height = 1200;
  c.fx = c.fy = 1000;
  c.cx = 800;
  c.cy = 600;
  return {view};
}

constexpr double kLargePixel = 0.001;  // at the Gaussians of Side()

// `count` disks side by side that face the camera; `px` is the deviation of one, px.
template <typename Px>
Model Side(size_t count, const Px& px) {
  Model model;
  model.lita = model.use_pdm = false;
  model.pixel_filter = PixelFilter::kMip;
  model.splats = Splats(count);
  for (size_t i = 0; i < count; ++i) {
    model.splats.at(i, kMean) = static_cast<float>(0.02 * (double(i) - 0.5 * count));
    model.splats.at(i, kMean + 2) = 1;
    for (int k = 0; k < 3; ++k) {
      model.splats.at(i, kLogScale + k) = static_cast<float>(std::log(kLargePixel * px(i)));
    }
    model.splats.at(i, kRawQuat) = 1;
    model.splats.at(i, kLogitOpacity) = 1;
  }
  return model;
}

TEST(ExportScene, GaussiansSmallerThanAPixelCountByTheirArea) {
  Model model = Side(40, [](size_t i) { return i % 2 == 0 ? 0.3 : 1.5; });
  // 0.95 of the small ones, 0.15 of the others, whose area is 25 times as large.
  for (size_t i = 0; i < 40; ++i) model.splats.at(i, kLogitOpacity) = i % 2 == 0 ? 3.0f : -1.7f;
  ExportRequest request;
  request.max_splats = 20;
  const auto kept = MakeViewerScene(model, LargeViews(), {0, -1, 0}, request);
  ASSERT_TRUE(kept.ok()) << kept.status();
  ASSERT_EQ(kept->splats.size(), 20u);
  EXPECT_FALSE(kept->antialiased);
  for (size_t i = 0; i < 20; ++i) {
    EXPECT_EQ(kept->splats.at(i, kMean), model.splats.at(2 * i + 1, kMean)) << i;
  }
}

TEST(ExportScene, SpzHoldsGaussiansSmallerThanAPixel) {
  const TempDir dir;
  const Model model = Side(50, [](size_t i) { return i % 5 == 0 ? 0.2 : 1.5; });
  ExportRequest request;
  request.format = SceneFormat::kSpz;
  const auto count = MakeScene(model, LargeViews())->Export(dir / "a.spz", request);
  ASSERT_TRUE(count.ok()) << count.status();
  EXPECT_EQ(*count, 50);
}

TEST(ExportScene, AntialiasedScenesAreAsTrained) {
  Model model = SmallModel();
  ExportRequest request;
  request.format = SceneFormat::kSog;
  const auto changed = Made(model, request);
  request.antialiased = true;
  const auto trained = Made(model, request);
  ASSERT_TRUE(changed.ok() && trained.ok());
  EXPECT_TRUE(trained->antialiased);
  EXPECT_FALSE(changed->antialiased);
  EXPECT_EQ(trained->splats.at(3, kLogitOpacity), model.splats.at(3, kLogitOpacity));
  EXPECT_NE(changed->splats.at(3, kLogitOpacity), model.splats.at(3, kLogitOpacity));
  request.antialiased = false;
  request.format = SceneFormat::kHtml;  // brings its viewer
  const auto page = Made(model, request);
  ASSERT_TRUE(page.ok()) << page.status();
  EXPECT_TRUE(page->antialiased);
  EXPECT_EQ(page->splats.at(3, kLogitOpacity), model.splats.at(3, kLogitOpacity));
  model.pixel_filter = PixelFilter::kDilate;
  request.antialiased = true;
  EXPECT_EQ(Reason(Made(model, request).status()), "CHANNEL_UNAVAILABLE");
}

TEST(ExportScene, ARaisedTokenEndsWhatTakesLong) {
  ExportRequest request;
  request.cancel.Cancel();
  EXPECT_TRUE(absl::IsCancelled(Made(SmallModel(), request).status()));
  request.antialiased = true;
  request.format = SceneFormat::kSog;
  const auto trained = Made(SmallModel(), request);
  ASSERT_TRUE(trained.ok()) << trained.status();
  for (const auto encode : {EncodeSog, EncodeSpz, EncodeSpzV4, EncodeUsda}) {
    EXPECT_TRUE(absl::IsCancelled(encode(*trained).status()));
  }
}

TEST(ExportScene, WhatCannotBeIsRefused) {
  const double kNan = std::numeric_limits<double>::quiet_NaN();
  const auto reason = [](auto change) {
    ExportRequest request;
    change(&request);
    return Reason(Made(SmallModel(), request).status());
  };
  for (double scale : {0.0, -1.0, kNan, 1e9}) {
    EXPECT_EQ(reason([&](ExportRequest* r) { r->scale = scale; }), "EXPORT_OPTION_INVALID");
  }
  EXPECT_EQ(reason([](ExportRequest* r) { r->max_splats = -1; }), "EXPORT_OPTION_INVALID");
  for (const int format : {-1, static_cast<int>(SceneFormat::kMeshGlb) + 1, 1000}) {
    EXPECT_EQ(reason([&](ExportRequest* r) { r->format = static_cast<SceneFormat>(format); }),
              "EXPORT_OPTION_INVALID");
  }
  EXPECT_EQ(reason([&](ExportRequest* r) {
              r->crop = Box{{0, 0, 0}, {1, kNan, 1}};
            }),
            "EXPORT_OPTION_INVALID");
  EXPECT_EQ(reason([](ExportRequest* r) {
              r->crop = Box{{0, 0, 0}, {1, -1, 1}};
            }),
            "EXPORT_OPTION_INVALID");
  ExportRequest untagged;
  untagged.antialiased = true;
  const absl::Status no_tag = CheckExport(untagged);
  EXPECT_EQ(Reason(no_tag), "EXPORT_OPTION_INVALID");
  EXPECT_NE(no_tag.message().find("; compressed-ply, spz, spz-v4, sog and html have"),
            std::string::npos)
      << no_tag;
  EXPECT_EQ(reason([](ExportRequest* r) {
              r->format = SceneFormat::kUsda;
              r->up = UpAxis::kX;
            }),
            "EXPORT_OPTION_INVALID");
  EXPECT_EQ(reason([](ExportRequest* r) {
              r->crop = Box{{50, 50, 50}, {51, 51, 51}};
            }),
            "EXPORT_EMPTY");
  EXPECT_EQ(reason([](ExportRequest* r) { r->exposure_stops = 11; }), "EXPOSURE_INVALID");
  EXPECT_EQ(reason([](ExportRequest* r) { r->light = -5; }), "LIGHT_INVALID");
}

}  // namespace
}  // namespace litags
