#include "engine/pipeline/viewer_splats.h"

#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "engine/core/image.h"
#include "engine/core/rng.h"
#include "engine/core/temp_dir_test_util.h"
#include "engine/export/export_test_util.h"
#include "engine/io/file_util.h"
#include "engine/io/ply.h"
#include "engine/pipeline/export_scene.h"
#include "engine/pipeline/model_scene.h"
#include "engine/render/constants.h"
#include "gtest/gtest.h"

namespace litags {
namespace {

constexpr int kSize = 96;  // px, at 100 px per unit of X/Z, from a distance of 4 units
constexpr double kPixel = 0.04;

std::vector<View> FrontViews() {
  std::vector<View> views;
  for (int i = 0; i < 4; ++i) {
    View view;
    view.name = std::to_string(i);
    Camera& c = view.camera;
    c.width = c.height = kSize;
    c.fx = c.fy = 100;
    c.cx = c.cy = kSize / 2;
    EXPECT_TRUE(c.LookAt({0.2 * i, -0.1 * i, -4}, {0, 0, 0}, {0, -1, 0}).ok());
    views.push_back(view);
  }
  return views;
}

// Disks that face the cameras, about `px` pixels wide.
Splats Disks(size_t n, double px) {
  const CounterRng rng(3, 1);
  Splats splats(n);
  for (size_t i = 0; i < n; ++i) {
    uint64_t counter = i * 100;
    const auto normal = [&] { return static_cast<float>(rng.Normal(counter++)); };
    for (int k = 0; k < 3; ++k) splats.at(i, kMean + k) = (k < 2 ? 0.6f : 0.1f) * normal();
    for (int k = 0; k < 3; ++k) {
      splats.at(i, kLogScale + k) =
          static_cast<float>(std::log(kPixel * px * (k < 2 ? 1 : 0.1))) + 0.2f * normal();
    }
    splats.at(i, kRawQuat) = 1;
    splats.at(i, kLogitOpacity) = normal();
    for (int c = 0; c < 3; ++c) splats.at(i, kShDc + c) = normal();
  }
  return splats;
}

TEST(SplatsForViewers, DilatedLookMuchAsTheyDidWithTheMipFilter) {
  std::vector<View> views = FrontViews();
  const struct {
    double px;          // of a disk
    double least;       // how many times nearer they get
    double aspect = 1;  // of a pixel
  } cases[] = {{0.2, 2}, {0.5, 4}, {1, 10}, {3, 12}, {0.5, 3, 2}, {1, 3, 2}, {3, 2.5, 2}};
  for (const auto& c : cases) {
    for (View& view : views) view.camera.fy = c.aspect * view.camera.fx;
    const Splats splats = Disks(600, c.px);
    const Splats exported = SplatsForViewers(views, PixelFilter::kMip, kEps2d, splats);
    for (const View& view : views) {
      const Planes want = Picture(splats, view.camera, PixelFilter::kMip);
      const double before = Difference(Picture(splats, view.camera, PixelFilter::kDilate), want);
      const double after = Difference(Picture(exported, view.camera, PixelFilter::kDilate), want);
      EXPECT_LT(c.least * after, before) << c.px << " px, view " << view.name;
    }
  }
}

TEST(SplatsForViewers, AreWhatScenesOfTheMipFilterExport) {
  const TempDir dir;
  const std::vector<View> views = FrontViews();
  Model model;
  model.lita = model.use_pdm = false;
  model.splats = Disks(30, 0.5);
  for (const auto& [filter, want] :
       {std::pair(PixelFilter::kMip,
                  SplatsForViewers(views, PixelFilter::kMip, kEps2d, model.splats)),
        std::pair(PixelFilter::kDilate, model.splats)}) {
    model.pixel_filter = filter;
    ASSERT_TRUE(MakeScene(model, views)->ExportPly(dir / "a.ply", /*light=*/0).ok());
    const auto ply = ReadFile(dir / "a.ply", "", int64_t{1} << 20);
    ASSERT_TRUE(ply.ok()) << ply.status();
    EXPECT_TRUE(*ply == EncodePly(want, /*lita_attributes=*/false));
  }
}

// PlayCanvas adds a quarter of 3DGS' to covariances.
TEST(SplatsForViewers, HaveTheSizeThatViewersOfTheFormatMakeRight) {
  Model model;
  model.lita = model.use_pdm = false;
  model.pixel_filter = PixelFilter::kMip;
  model.splats = Disks(1, 2);
  for (int k = 0; k < 3; ++k) model.splats.at(0, kMean + k) = 0;
  model.splats.at(0, kLogScale) = static_cast<float>(std::log(2 * kPixel));
  const auto size = [&](SceneFormat format) {
    ExportRequest request;
    request.format = format;
    const auto made = MakeViewerScene(model, FrontViews(), {0, -1, 0}, request);
    EXPECT_TRUE(made.ok()) << made.status();
    const double scale = made.ok() ? std::exp(made->splats.at(0, kLogScale)) / kPixel : 0;
    return scale * scale;
  };
  EXPECT_NEAR(size(SceneFormat::kPly) + kEps2d, 4 + kMipEps2d, 0.01);
  EXPECT_NEAR(size(SceneFormat::kCompressedPly) + 0.075, 4 + kMipEps2d, 0.01);
  EXPECT_NEAR(size(SceneFormat::kSog) + 0.075, 4 + kMipEps2d, 0.01);
  model.pixel_filter = PixelFilter::kDilate;
  EXPECT_NEAR(size(SceneFormat::kPly), 4, 1e-4);
  EXPECT_NEAR(size(SceneFormat::kCompressedPly), 4, 1e-4) << "the server's page adds kEps2d";
  EXPECT_NEAR(size(SceneFormat::kSog) + 0.075, 4 + kEps2d, 0.01);
}

TEST(SplatsForViewers, OfScenesWithoutTheMipFilterKeepTheirOpacity) {
  const Splats splats = Disks(20, 0.5);
  const Splats exported = SplatsForViewers(FrontViews(), PixelFilter::kDilate, 0.075f, splats);
  for (size_t i = 0; i < splats.size(); ++i) {
    EXPECT_EQ(exported.at(i, kLogitOpacity), splats.at(i, kLogitOpacity));
    EXPECT_GT(exported.at(i, kLogScale), splats.at(i, kLogScale));
  }
}

TEST(SplatsForViewers, ThoseThatNoViewSeesStayAsTheyAre) {
  Splats splats = Disks(20, 0.5);
  for (size_t i = 0; i < splats.size(); ++i) splats.at(i, kMean + 2) -= 50;
  EXPECT_EQ(SplatsForViewers(FrontViews(), PixelFilter::kMip, kEps2d, splats).data(),
            splats.data());
  EXPECT_EQ(SplatsForViewers({}, PixelFilter::kMip, kEps2d, splats).data(), splats.data());
}

TEST(SplatsForViewers, ExtremesStayFinite) {
  Splats splats = Disks(4, 1);
  for (int k = 0; k < 3; ++k) {
    splats.at(0, kLogScale + k) = -200;
    splats.at(1, kLogScale + k) = 80;
  }
  splats.at(1, kLogitOpacity) = 90;
  splats.at(2, kLogitOpacity) = 90;
  splats.at(3, kLogitOpacity) = -90;
  const Splats exported = SplatsForViewers(FrontViews(), PixelFilter::kMip, kEps2d, splats);
  EXPECT_EQ(exported.FirstNotFinite(), exported.size());
}

}  // namespace
}  // namespace litags
