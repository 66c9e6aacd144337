#include "engine/pipeline/surface_points.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "engine/core/error.h"
#include "engine/core/error_test_util.h"
#include "engine/core/temp_dir_test_util.h"
#include "engine/io/test_util.h"
#include "engine/pipeline/wall_test_util.h"

namespace litags {
namespace {

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
  EXPECT_EQ(Reason(SurfacePoints(*scene, request).status()), "EXPORT_OPTION_INVALID");
  request.antialiased = false;
  request.crop = Box{{50, 50, 50}, {51, 51, 51}};
  EXPECT_EQ(Reason(SurfacePoints(*scene, request).status()), "EXPORT_EMPTY");
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

// Of six cameras side by side only one looks at the wall.
TEST(SurfacePoints, AreOfWhatOneDirectionOfPanoramasSees) {
  std::vector<View> views;
  for (int i = 0; i < 6 * 64; ++i) {
    View view = WallViews()[i / 6 % 3];
    view.name = std::to_string(i);
    if (i % 6 != 3) view.camera = view.camera.Moved({0, 0, 2 * kWallDepth});  // behind the wall
    views.push_back(view);
  }
  const auto points =
      SurfacePoints(*MakeScene(WallModel(), views), RequestOf(SceneFormat::kPoints));
  ASSERT_TRUE(points.ok()) << points.status();
  EXPECT_GT(points->size(), 500u);
}

TEST(SurfacePoints, OfASceneWithOneLightAreRefusedInAnother) {
  const TempDir dir;
  ExportRequest request = RequestOf(SceneFormat::kPoints);
  request.light = 0.5;
  const absl::Status status = WallScene()->Export(dir / "points", request).status();
  EXPECT_EQ(Reason(status), "CHANNEL_UNAVAILABLE");
  EXPECT_EQ(GetErrorDetail(status)->field, "light");
}

TEST(SurfacePoints, CancelledSoon) {
  ExportRequest request = RequestOf(SceneFormat::kLas);
  request.cancel.Cancel();
  EXPECT_EQ(SurfacePoints(*WallScene(), request).status().code(), absl::StatusCode::kCancelled);
}

}  // namespace
}  // namespace litags
