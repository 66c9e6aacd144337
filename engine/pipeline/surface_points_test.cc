#include "engine/pipeline/surface_points.h"

#include <gtest/gtest.h>

#include <cmath>

#include "engine/io/test_util.h"
#include "engine/pipeline/scene_test_util.h"

namespace litags {
namespace {

constexpr double kWallDepth = 5;
constexpr float kRedCode = 0.8f, kOtherCode = 0.2f;

void AddGaussian(const std::array<double, 3>& mean, const std::array<double, 3>& sigma,
                 const std::array<float, 3>& code, size_t i, Splats* splats) {
  for (int k = 0; k < 3; ++k) {
    splats->at(i, kMean + k) = static_cast<float>(mean[k]);
    splats->at(i, kLogScale + k) = static_cast<float>(std::log(sigma[k]));
    splats->at(i, kShDc + k) = static_cast<float>((code[k] - 0.5) / kSh0);
  }
  splats->at(i, kRawQuat) = 1;
  splats->at(i, kLogitOpacity) = 5;
}

// A red wall 5 units in front of three cameras, and a blue blob that only the first one sees.
std::shared_ptr<const Scene> WallScene() {
  constexpr int kColumns = 80, kRows = 50;
  constexpr double kSpacing = 0.12;
  Model model;
  model.lita = model.use_pdm = false;
  model.splats = Splats(kColumns * kRows + 1);
  for (int y = 0; y < kRows; ++y) {
    for (int x = 0; x < kColumns; ++x) {
      AddGaussian({kSpacing * (x - kColumns / 2), kSpacing * (y - kRows / 2), kWallDepth},
                  {0.09, 0.09, 0.003}, {kRedCode, kOtherCode, kOtherCode}, size_t(y) * kColumns + x,
                  &model.splats);
    }
  }
  AddGaussian({-1.9, 0, 1.5}, {0.08, 0.08, 0.08}, {kOtherCode, kOtherCode, kRedCode},
              kColumns * kRows, &model.splats);
  std::vector<View> views;
  for (int v = 0; v < 3; ++v) {
    Camera camera;
    camera.width = 96;
    camera.height = 64;
    camera.fx = camera.fy = 60;
    camera.cx = 48;
    camera.cy = 32;
    camera.t[0] = 1 - v;  // centres at -1, 0 and 1
    views.push_back({"photo" + std::to_string(v) + ".png", camera});
  }
  return MakeScene(std::move(model), std::move(views));
}

ExportRequest RequestOf(SceneFormat format) {
  ExportRequest request;
  request.format = format;
  return request;
}

TEST(SurfacePoints, LieOnTheWallAndHaveItsColor) {
  const auto points = SurfacePoints(*WallScene(), RequestOf(SceneFormat::kLas));
  ASSERT_TRUE(points.ok()) << points.status();
  EXPECT_GT(points->size(), 500u);
  double red = 0;
  for (const ColoredPoint& point : *points) {
    EXPECT_NEAR(point.xyz[2], kWallDepth, 0.02);
    EXPECT_GT(point.rgb[0], point.rgb[2]);  // the blob's faint rim tints what is behind
    red += point.rgb[0] / double(points->size());
  }
  EXPECT_NEAR(red, 255 * kRedCode, 4);
}

TEST(SurfacePoints, OptionsChooseAndPlaceThem) {
  const auto scene = WallScene();
  ExportRequest request = RequestOf(SceneFormat::kPoints);
  request.crop = Box{{-0.5, -0.5, 4}, {0.5, 0.5, 6}};
  const auto cropped = SurfacePoints(*scene, request);
  ASSERT_TRUE(cropped.ok()) << cropped.status();
  for (const ColoredPoint& point : *cropped) {
    for (int k = 0; k < 2; ++k) EXPECT_LT(std::abs(point.xyz[k]), 0.51);
  }
  request.max_splats = 10;
  request.scale = 100;
  request.up = UpAxis::kZ;
  const auto placed = SurfacePoints(*scene, request);
  ASSERT_TRUE(placed.ok()) << placed.status();
  ASSERT_EQ(placed->size(), 10u);
  // The cameras' up is -y: it becomes z, and the wall stays as far away.
  for (const ColoredPoint& point : *placed) {
    EXPECT_NEAR(std::abs(point.xyz[1]), 100 * kWallDepth, 2);
    EXPECT_LT(std::abs(point.xyz[2]), 51);
  }
  request.antialiased = true;
  EXPECT_EQ(ReasonOf(SurfacePoints(*scene, request).status()), "EXPORT_OPTION_INVALID");
  request.antialiased = false;
  request.crop = Box{{50, 50, 50}, {51, 51, 51}};
  EXPECT_EQ(ReasonOf(SurfacePoints(*scene, request).status()), "EXPORT_EMPTY");
}

TEST(SurfacePoints, AreWrittenLikeAnyFormat) {
  const TempDir dir;
  const auto scene = WallScene();
  for (const SceneFormat format : {SceneFormat::kPoints, SceneFormat::kLas}) {
    const auto count = scene->Export(dir / "points", RequestOf(format));
    ASSERT_TRUE(count.ok()) << count.status();
    EXPECT_EQ(*count, static_cast<int64_t>(SurfacePoints(*scene, RequestOf(format))->size()));
    EXPECT_GT(Bytes(dir / "points").size(), 20 * static_cast<size_t>(*count));
  }
}

TEST(SurfacePoints, CancelledSoon) {
  ExportRequest request = RequestOf(SceneFormat::kLas);
  request.cancel.Cancel();
  EXPECT_EQ(SurfacePoints(*WallScene(), request).status().code(), absl::StatusCode::kCancelled);
}

}  // namespace
}  // namespace litags
