#include "engine/tools/evaluation/surface_errors.h"

#include <gtest/gtest.h>

#include <cmath>

#include "engine/core/error_test_util.h"
#include "engine/core/image.h"
#include "engine/core/temp_dir_test_util.h"
#include "engine/io/depth_io.h"
#include "engine/tools/evaluation/surface_distance.h"

namespace litags {
namespace {

constexpr int kWidth = 60, kHeight = 40;
constexpr double kDepth = 2;

std::vector<View> OneView() {
  View view;
  view.name = "a.png";
  Camera& camera = view.camera;
  camera.width = kWidth;
  camera.height = kHeight;
  camera.fx = camera.fy = 40;
  camera.cx = kWidth / 2.0;
  camera.cy = kHeight / 2.0;
  return {view};
}

// A wall at kDepth, of which the truth knows all that the view sees.
TrueSurface Wall(const TempDir& dir) {
  Planes depth(1, kHeight, kWidth);
  std::fill(depth.data.begin(), depth.data.end(), static_cast<float>(kDepth));
  EXPECT_TRUE(WritePfm(dir / "a.pfm", depth).ok());
  const auto truth = ReadTrueSurface(OneView(), dir.path());
  EXPECT_TRUE(truth.ok()) << truth.status();
  return truth.value_or(TrueSurface());
}

// Points or triangles of a plane at z = `depth`, 0.1 apart, from x = `from` to 1.5.
TriangleMesh Plane(double depth, double from, bool triangles) {
  TriangleMesh mesh;
  const int columns = static_cast<int>(std::lround((1.5 - from) / 0.1)) + 1;
  for (int y = 0; y <= 20; ++y) {
    for (int x = 0; x < columns; ++x) {
      mesh.vertices.push_back({{from + 0.1 * x, 0.1 * y - 1, depth}, {}});
      const auto at = static_cast<uint32_t>(y * columns + x), step = uint32_t(columns);
      if (!triangles || x + 1 == columns || y == 20) continue;
      mesh.triangles.push_back({at, at + step, at + 1});
      mesh.triangles.push_back({at + 1, at + step, at + step + 1});
    }
  }
  return mesh;
}

TEST(SurfaceErrors, AShiftedMeshIsOffByTheShift) {
  const TempDir dir;
  const SurfaceErrors errors = MeasureSurface(Plane(kDepth + 0.03, -1.5, true), Wall(dir), 1);
  for (const DistanceQuantiles& q : {errors.accuracy, errors.completeness}) {
    EXPECT_NEAR(q.median, 0.03, 1e-6);
    EXPECT_NEAR(q.ninety, 0.03, 0.01);  // the plane reaches beyond the wall by half a pixel
    EXPECT_NEAR(q.median_of_depth, 0.03 / kDepth, 1e-6);
  }
}

TEST(SurfaceErrors, HalfAMeshIsAccurateButNotComplete) {
  const TempDir dir;
  const SurfaceErrors errors = MeasureSurface(Plane(kDepth, 0, true), Wall(dir), 1);
  EXPECT_LT(errors.accuracy.ninety, 0.03);
  EXPECT_NEAR(errors.completeness.ninety, 0.8 * 1.5, 0.06);  // 0.8 of the half that is not there
}

TEST(SurfaceErrors, PointsAreAsFarAsTheirSpacing) {
  const TempDir dir;
  const TrueSurface wall = Wall(dir);
  const SurfaceErrors points = MeasureSurface(Plane(kDepth, -1.5, false), wall, 1);
  EXPECT_LT(points.accuracy.median, 1e-6);
  EXPECT_GT(points.completeness.median, 0.02);
  EXPECT_LT(points.completeness.ninety, 0.1 / std::sqrt(2));
}

TEST(SurfaceErrors, MissingAndOtherMapsAreNamed) {
  const TempDir dir;
  EXPECT_EQ(Reason(ReadTrueSurface(OneView(), dir.path()).status()), "NO_TRUTH");
  Planes small(1, 4, 4);
  small.data[0] = 1;
  ASSERT_TRUE(WritePfm(dir / "a.pfm", small).ok());
  EXPECT_EQ(Reason(ReadTrueSurface(OneView(), dir.path()).status()), "SIZE_MISMATCH");
}

// A search among no points ended the program.
TEST(SurfaceErrors, MapsThatKnowNoPixelAreNoTruth) {
  const TempDir dir;
  ASSERT_TRUE(WritePfm(dir / "a.pfm", Planes(1, kHeight, kWidth)).ok());
  EXPECT_EQ(Reason(ReadTrueSurface(OneView(), dir.path()).status()), "NO_TRUTH");
}

TEST(SurfaceDistance, ToATriangleIsToItsPlaneEdgeOrCorner) {
  const std::array<double, 3> a = {0, 0, 0}, b = {4, 0, 0}, c = {0, 4, 0};
  EXPECT_NEAR(DistanceToTriangle({1, 1, 3}, a, b, c), 3, 1e-12);
  EXPECT_NEAR(DistanceToTriangle({1, 1, -3}, a, b, c), 3, 1e-12);
  EXPECT_NEAR(DistanceToTriangle({2, -3, 4}, a, b, c), 5, 1e-12);
  EXPECT_NEAR(DistanceToTriangle({3, 3, 0}, a, b, c), std::sqrt(2), 1e-12);
  EXPECT_NEAR(DistanceToTriangle({7, 0, 4}, a, b, c), 5, 1e-12);
  EXPECT_NEAR(DistanceToTriangle({1, 3, 0}, a, a, a), std::sqrt(10), 1e-12);
}

}  // namespace
}  // namespace litags
