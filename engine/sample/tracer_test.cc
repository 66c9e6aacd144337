#include "engine/sample/tracer.h"

#include <cmath>
#include <limits>
#include <numbers>

#include "engine/core/rng.h"
#include "engine/sample/texture.h"
#include "gtest/gtest.h"

namespace litags::sample {
namespace {

Material White() {
  Material white;
  white.albedo = [](const SurfacePoint&) { return Vec3{1, 1, 1}; };
  return white;
}

World MakeWorld(std::vector<Shape> shapes, std::vector<Light> lights = {}, Vec3 ambient = {}) {
  return World(std::move(shapes), {White()}, std::move(lights), ambient, ambient);
}

Camera MakeCamera(int width, int height, Vec3 eye, Vec3 target) {
  Camera camera;
  camera.width = width;
  camera.height = height;
  camera.fx = camera.fy = 0.9 * width;
  camera.cx = 0.5 * width;
  camera.cy = 0.5 * height;
  EXPECT_TRUE(camera.LookAt(ToArray(eye), ToArray(target), {0, 0, 1}).ok());
  return camera;
}

// Depths are stored as float: a relative error of 6e-8, and some rounding before.
constexpr double kDepthTolerance = 1e-5;

TEST(TraceDepth, OfASphereIsTheClosedForm) {
  const Vec3 center{0.3, -0.2, 1.1};
  const double radius = 0.4;
  const World world = MakeWorld({{Shape::Kind::kSphere, center, {radius, radius, radius}, {}, 0}});
  const Camera camera = MakeCamera(41, 31, {1.5, -2, 1.7}, center + Vec3{0.1, 0, 0.05});
  const Planes depth = TraceDepth(world, camera, 1);

  // In the camera's frame: |t d - c| = r with d = (u, v, 1), so t is the depth.
  const Vec3 c = ToVec3(camera.CamFromWorld(ToArray(center)));
  int inside = 0;
  for (int y = 0; y < 31; ++y) {
    for (int x = 0; x < 41; ++x) {
      const Vec3 d{(x + 0.5 - 20.5) / camera.fx, (y + 0.5 - 15.5) / camera.fy, 1};
      const double b = Dot(d, c), disc = b * b - Dot(d, d) * (Dot(c, c) - radius * radius);
      if (disc < 0) {
        EXPECT_EQ(depth.at(0, y, x), 0.0f);
      } else {
        ++inside;
        EXPECT_NEAR(depth.at(0, y, x), (b - std::sqrt(disc)) / Dot(d, d), kDepthTolerance);
      }
    }
  }
  EXPECT_GT(inside, 100);
}

TEST(TraceDepth, OfAFloorIsTheClosedForm) {
  const World world = MakeWorld({{Shape::Kind::kBox, {0, 0, -0.5}, {1e4, 1e4, 0.5}, {}, 0}});
  const Camera camera = MakeCamera(20, 16, {0.4, -2, 1.3}, {0, 0, 0});
  const Planes depth = TraceDepth(world, camera, 1);
  for (int y = 0; y < 16; ++y) {
    for (int x = 0; x < 20; ++x) {
      // The ray's world z falls from the eye's 1.3 to 0.
      const auto& R = camera.R;
      const double fall =
          R[2] * (x + 0.5 - 10) / camera.fx + R[5] * (y + 0.5 - 8) / camera.fy + R[8];
      ASSERT_LT(fall, 0);
      EXPECT_NEAR(depth.at(0, y, x) / (-1.3 / fall), 1, 1e-6);
    }
  }
}

TEST(TraceDepth, OfATurnedBoxAndACylinderFromInsideAndOutside) {
  const World box = MakeWorld(
      {{Shape::Kind::kBox, {0, 2, 0}, {0.5, 0.5, 0.5}, YawTilt(std::numbers::pi / 4), 0}});
  Hit hit;
  ASSERT_TRUE(box.Intersect({{0, 0, 0}, {0, 1, 0}}, &hit));
  EXPECT_NEAR(hit.t, 2 - std::sqrt(0.5), 1e-9);  // meets the corner
  ASSERT_TRUE(box.Intersect({{0, 2, 0}, {0, 1, 0}}, &hit));
  EXPECT_NEAR(hit.t, std::sqrt(0.5), 1e-9);
  EXPECT_LT(hit.normal.y, 0);  // against the ray, from inside too

  const World can = MakeWorld({{Shape::Kind::kCylinder, {0, 2, 0}, {0.5, 0.5, 0.3}, {}, 0}});
  ASSERT_TRUE(can.Intersect({{0, 0, 0}, {0, 1, 0}}, &hit));
  EXPECT_NEAR(hit.t, 1.5, 1e-9);
  ASSERT_TRUE(can.Intersect({{0.2, 2.1, 3}, {0, 0, -1}}, &hit));
  EXPECT_NEAR(hit.t, 2.7, 1e-9);
  EXPECT_NEAR(hit.normal.z, 1, 1e-12);
  EXPECT_FALSE(can.Intersect({{0.6, 2, 3}, {0, 0, -1}}, &hit));
}

TEST(World, TheTreeFindsWhatTryingEveryShapeFinds) {
  const World room = MakeRoom(0);
  std::vector<World> alone;
  for (Shape shape : room.shapes()) {
    shape.material = 0;
    alone.push_back(MakeWorld({shape}));
  }
  const CounterRng rng(5, 0);
  for (uint64_t i = 0; i < 500; ++i) {
    const auto u = [&](int k) { return 2 * rng.Uniform(8 * i + k) - 1; };
    const Ray ray{{2 * u(0), 1.8 * u(1), 1.3 + 1.2 * u(2)}, Normalized({u(3), u(4), u(5)})};
    double nearest = std::numeric_limits<double>::infinity();
    Hit hit;
    for (const World& world : alone) {
      if (world.Intersect(ray, &hit)) nearest = std::min(nearest, hit.t);
    }
    ASSERT_TRUE(room.Intersect(ray, &hit)) << "a closed room";
    EXPECT_NEAR(hit.t, nearest, 1e-12) << i;
  }
}

TEST(TraceRadiance, UnderEvenAmbientLightAConvexBodyShowsItsAlbedo) {
  // Irradiance E on a surface of albedo 1 gives radiance E / pi in every direction.
  const World world =
      MakeWorld({{Shape::Kind::kSphere, {0, 0, 0}, {1, 1, 1}, {}, 0}}, {}, {2, 3, 4});
  const Planes light = TraceRadiance(world, MakeCamera(5, 5, {0, -1.2, 0}, {0, 0, 0}), {});
  for (int c = 0; c < 3; ++c) {
    EXPECT_NEAR(light.at(c, 2, 2), (2 + c) / std::numbers::pi, 1e-6);
  }
}

TEST(TraceRadiance, ASmallLightFallsOffWithTheSquareOfItsDistance) {
  // A sphere of radius r at height h above the floor gives pi L (r / h)^2.
  for (const double height : {1.0, 2.0}) {
    Light lamp{Light::Kind::kSphere, {0, 0, height}, {}, {}, 0.05, {1, 1, 1}};
    const World world = MakeWorld({{Shape::Kind::kBox, {0, 0, -0.5}, {9, 9, 0.5}, {}, 0}}, {lamp});
    const Planes light = TraceRadiance(world, MakeCamera(3, 3, {0, -0.05, 0.4}, {0, 0, 0}), {});
    const double expected = 0.05 * 0.05 / (height * height);
    // The pixel sees some centimetres of floor around the foot of the lamp.
    EXPECT_NEAR(light.at(0, 1, 1) / expected, 1, 0.05) << height;
  }
}

TEST(TraceRadiance, AnAreaLightCastsASoftShadow) {
  // A ceiling light of half width 0.2 at height 2 over a screen at height 1 that covers x < 0:
  // the floor is dark left of -0.2, half lit at 0 and fully lit right of 0.2.
  Light panel{Light::Kind::kRectangle, {0, 0, 2}, {0.2, 0, 0}, {0, -0.2, 0}, 0, {1, 1, 1}};
  const Shape floor{Shape::Kind::kBox, {0, 0, -0.5}, {9, 9, 0.5}, {}, 0};
  const Shape screen{Shape::Kind::kBox, {-4, 0, 1}, {4, 4, 0.001}, {}, 0};
  const World shaded = MakeWorld({floor, screen}, {panel}), open = MakeWorld({floor}, {panel});
  const auto lit = [&](double x) {
    const Camera camera = MakeCamera(3, 3, {x, -0.02, 0.3}, {x, 0, 0});
    const TraceOptions fine{16, 0, 1};
    return TraceRadiance(shaded, camera, fine).at(0, 1, 1) /
           TraceRadiance(open, camera, fine).at(0, 1, 1);
  };
  EXPECT_NEAR(lit(-0.4), 0, 1e-6);
  EXPECT_NEAR(lit(0.4), 1, 1e-6);
  EXPECT_NEAR(lit(0.0), 0.5, 0.1);  // 256 samples, and the pixel is 0.1 wide
}

TEST(TraceRadiance, DoesNotDependOnTheNumberOfThreads) {
  const World world = MakeRoom(1);
  const Camera camera = MakeCamera(40, 30, {0.3, -2, 1.4}, {0, 0, 0.9});
  EXPECT_EQ(TraceRadiance(world, camera, {2, 7, 1}).data,
            TraceRadiance(world, camera, {2, 7, 3}).data);
}

TEST(Texture, SrgbCodesBecomeLinearLight) {
  EXPECT_NEAR(Rgb(0xFF0000).x, 1, 1e-12);
  EXPECT_NEAR(Rgb(0x00FF80).z, 0.21586, 1e-5);
}

}  // namespace
}  // namespace litags::sample
