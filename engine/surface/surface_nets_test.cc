#include "engine/surface/surface_nets.h"

#include <gtest/gtest.h>

#include "engine/surface/surface_test_util.h"

namespace litags {
namespace {

TriangleMesh MeshOf(const std::vector<SurfacePicture>& pictures, TsdfOptions options = {},
                    int least = 2) {
  TsdfVolume volume;
  EXPECT_TRUE(volume.Fuse(pictures, options).ok());
  return SurfaceNets(volume, least, options.threads);
}

std::array<double, 3> Normal(const TriangleMesh& mesh, const std::array<uint32_t, 3>& triangle) {
  std::array<double, 3> u, v;
  for (int k = 0; k < 3; ++k) {
    u[k] = mesh.vertices[triangle[1]].xyz[k] - mesh.vertices[triangle[0]].xyz[k];
    v[k] = mesh.vertices[triangle[2]].xyz[k] - mesh.vertices[triangle[0]].xyz[k];
  }
  return {u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]};
}

TEST(SurfaceNets, LieOnTheSurfaceAndHaveItsColor) {
  const TriangleMesh mesh = MeshOf(FourPictures());
  ASSERT_GT(mesh.vertices.size(), 2000u);
  ASSERT_GT(mesh.triangles.size(), 4000u);
  int far = 0, wrong_color = 0;
  double sum = 0;
  for (const ColoredPoint& vertex : mesh.vertices) {
    const double distance = DistanceToSurface(vertex.xyz);  // a voxel's side is about 0.04
    sum += distance;
    far += distance > 0.02;
    wrong_color += (vertex.rgb[0] > vertex.rgb[1]) != (vertex.xyz[2] < 1.5);
  }
  EXPECT_LT(sum / mesh.vertices.size(), 0.003);
  // The sphere's outline: these pictures have no edges left out.
  EXPECT_LT(far, 0.05 * mesh.vertices.size());
  EXPECT_LT(wrong_color, 0.02 * mesh.vertices.size());
}

TEST(SurfaceNets, TrianglesFaceTheCameras) {
  const TriangleMesh mesh = MeshOf(FourPictures());
  size_t away = 0;
  for (const auto& triangle : mesh.triangles) {
    const auto normal = Normal(mesh, triangle);
    const auto& p = mesh.vertices[triangle[0]].xyz;
    away += normal[0] * p[0] + normal[1] * p[1] + normal[2] * (p[2] + 3) > 0;
  }
  EXPECT_LT(away, 0.02 * mesh.triangles.size());
}

TEST(SurfaceNets, AreTheSameForAnyNumberOfThreads) {
  TsdfOptions options;
  options.threads = 1;
  const TriangleMesh one = MeshOf(FourPictures(), options);
  options.threads = 5;
  const TriangleMesh five = MeshOf(FourPictures(), options);
  EXPECT_EQ(one.triangles, five.triangles);
  ASSERT_EQ(one.vertices.size(), five.vertices.size());
  for (size_t i = 0; i < one.vertices.size(); ++i) {
    ASSERT_EQ(one.vertices[i].xyz, five.vertices[i].xyz);
    ASSERT_EQ(one.vertices[i].rgb, five.vertices[i].rgb);
  }
}

TEST(SurfaceNets, LieBetweenPicturesThatDiffer) {
  const TriangleMesh mesh = MeshOf({PictureFrom({0, 0, -3}, -0.03), PictureFrom({0, 0, -3}, 0.03)});
  double sum = 0;
  int count = 0;
  for (const ColoredPoint& vertex : mesh.vertices) {
    if (vertex.xyz[2] < 1.5) continue;
    sum += vertex.xyz[2] - kWallDepth;
    ++count;
  }
  ASSERT_GT(count, 1000);
  EXPECT_NEAR(sum / count, 0, 0.005);
}

TEST(SurfaceNets, WhatOnePictureShowsIsLeftOut) {
  EXPECT_TRUE(MeshOf({PictureFrom({0, 0, -3})}).triangles.empty());
  EXPECT_FALSE(MeshOf({PictureFrom({0, 0, -3})}, {}, 1).triangles.empty());
}

TEST(SurfaceNets, StayInTheBox) {
  TsdfOptions options;
  options.box = Box{{-0.5, -0.5, -2}, {0.5, 0.5, 1}};
  const TriangleMesh mesh = MeshOf(FourPictures(), options);
  ASSERT_GT(mesh.triangles.size(), 100u);
  for (const ColoredPoint& vertex : mesh.vertices) EXPECT_TRUE(options.box->Holds(vertex.xyz));
}

}  // namespace
}  // namespace litags
