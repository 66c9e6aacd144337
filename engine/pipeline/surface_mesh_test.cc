#include "engine/pipeline/surface_mesh.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "engine/core/error_test_util.h"
#include "engine/core/temp_dir_test_util.h"
#include "engine/export/formats.h"
#include "engine/io/test_util.h"
#include "engine/pipeline/wall_test_util.h"

namespace litags {
namespace {

TEST(SurfaceMesh, LiesOnTheWallAndHasItsColor) {
  const auto mesh = SurfaceMesh(*WallScene(), RequestOf(SceneFormat::kMeshPly));
  ASSERT_TRUE(mesh.ok()) << mesh.status();
  EXPECT_GT(mesh->triangles.size(), 1000u);
  double red = 0;
  for (const ColoredPoint& vertex : mesh->vertices) {
    EXPECT_NEAR(vertex.xyz[2], kWallDepth, 0.02);
    EXPECT_GT(vertex.rgb[0], vertex.rgb[2]);  // the blob's faint rim tints what is behind
    red += vertex.rgb[0] / double(mesh->vertices.size());
  }
  EXPECT_NEAR(red, 255 * kRedCode, 4);
}

TEST(SurfaceMesh, FollowsCropUpAndScale) {
  ExportRequest request = RequestOf(SceneFormat::kMeshGlb);  // Y up, where the cameras' is -y
  request.crop = Box{{-0.5, -0.5, 4}, {0.5, 0.2, 6}};
  request.scale = 100;
  const auto mesh = SurfaceMesh(*WallScene(), request);
  ASSERT_TRUE(mesh.ok()) << mesh.status();
  float highest = -100;
  for (const ColoredPoint& vertex : mesh->vertices) {
    EXPECT_LT(std::abs(vertex.xyz[0]), 51);
    EXPECT_GT(vertex.xyz[1], -21);
    EXPECT_LT(vertex.xyz[1], 51);
    EXPECT_NEAR(std::abs(vertex.xyz[2]), 100 * kWallDepth, 2);
    highest = std::max(highest, float(vertex.xyz[1]));
  }
  EXPECT_GT(highest, 30);
}

TEST(SurfaceMesh, IsTheSameForAnyNumberOfThreads) {
  const auto scene = WallScene();
  std::string bytes[2];
  for (const int i : {0, 1}) {
    ExportRequest request = RequestOf(SceneFormat::kMeshPly);
    request.threads = 1 + 3 * i;
    const auto mesh = SurfaceMesh(*scene, request);
    ASSERT_TRUE(mesh.ok()) << mesh.status();
    bytes[i] = EncodeMeshPly(*mesh).value();
  }
  EXPECT_TRUE(bytes[0] == bytes[1]);
}

TEST(SurfaceMesh, WhatDoesNotApplyIsRefusedByName) {
  const auto scene = WallScene();
  ExportRequest request = RequestOf(SceneFormat::kMeshPly);
  request.max_splats = 10;
  absl::Status status = SurfaceMesh(*scene, request).status();
  EXPECT_EQ(Reason(status), "EXPORT_OPTION_INVALID");
  EXPECT_NE(status.message().find("max_splats: mesh-ply holds triangles"), std::string::npos);
  request = RequestOf(SceneFormat::kMeshGlb);
  request.antialiased = true;
  EXPECT_EQ(Reason(SurfaceMesh(*scene, request).status()), "EXPORT_OPTION_INVALID");
}

TEST(SurfaceMesh, WithoutASurfaceSaysWhatToDo) {
  ExportRequest request = RequestOf(SceneFormat::kMeshPly);
  request.crop = Box{{50, 50, 50}, {51, 51, 51}};
  EXPECT_EQ(Reason(SurfaceMesh(*WallScene(), request).status()), "EXPORT_EMPTY");
  Model empty = WallModel();
  empty.splats.Resize(1);
  const absl::Status status =
      SurfaceMesh(*MakeScene(std::move(empty), WallViews()), RequestOf(SceneFormat::kMeshPly))
          .status();
  EXPECT_EQ(Reason(status), "EXPORT_EMPTY");
  EXPECT_NE(status.message().find("take more photos"), std::string::npos) << status;
}

TEST(SurfaceMesh, IsWrittenLikeAnyFormat) {
  const TempDir dir;
  const auto scene = WallScene();
  for (const SceneFormat format : {SceneFormat::kMeshPly, SceneFormat::kMeshGlb}) {
    const auto count = scene->Export(dir / "mesh", RequestOf(format));
    ASSERT_TRUE(count.ok()) << count.status();
    const auto mesh = SurfaceMesh(*scene, RequestOf(format));
    EXPECT_EQ(*count, static_cast<int64_t>(mesh->triangles.size()));
    EXPECT_TRUE(Bytes(dir / "mesh") == InfoOf(format).encode_mesh(*mesh).value());
  }
}

TEST(SurfaceMesh, CancelledSoon) {
  ExportRequest request = RequestOf(SceneFormat::kMeshPly);
  request.cancel.Cancel();
  EXPECT_EQ(SurfaceMesh(*WallScene(), request).status().code(), absl::StatusCode::kCancelled);
}

}  // namespace
}  // namespace litags
