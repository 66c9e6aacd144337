// The made-up world of the sample capture: shapes with procedural materials, and lights.
// Right-handed, z up, metres. Colours are linear light.
#ifndef LITAGS_ENGINE_SAMPLE_WORLD_H_
#define LITAGS_ENGINE_SAMPLE_WORLD_H_

#include <functional>
#include <memory>
#include <vector>

#include "engine/sample/vec.h"

namespace litags::sample {

// Where a texture is evaluated: in the shape's own frame, centred on it, metres.
struct SurfacePoint {
  Vec3 position;
  Vec3 normal;
};

struct Material {
  std::function<Vec3(const SurfacePoint&)> albedo;  // [0, 1] per channel
  Vec3 emission;                                    // radiance; emitters cast no shadow
  double gloss = 0;  // share of the Fresnel reflection of a varnished surface, [0, 1]
};

struct Shape {
  enum class Kind { kSphere, kBox, kCylinder, kRoom };
  Kind kind = Kind::kBox;
  Vec3 center;
  // Box and room: half extents. Sphere: x is the radius. Cylinder (axis z, capped): x is the
  // radius, z the half height.
  Vec3 half;
  Frame frame;
  int material = 0;
};

struct Light {
  enum class Kind { kRectangle, kSphere };
  Kind kind = Kind::kRectangle;
  Vec3 center;
  Vec3 u, v;          // half edges of a rectangle; it shines towards cross(u, v)
  double radius = 0;  // of a sphere
  Vec3 radiance;
};

struct Ray {
  Vec3 origin, direction;  // direction is of unit length, except where a caller says otherwise
};

struct Hit {
  double t = 0;    // along the direction
  int shape = -1;  // index into World::shapes
  Vec3 normal;     // world, unit, against the ray
  SurfacePoint local;
};

class Bvh;

// Immutable once built; safe to trace from several threads.
class World {
 public:
  // At most one shape may be a room: the inside of a box, which every ray hits.
  World(std::vector<Shape> shapes, std::vector<Material> materials, std::vector<Light> lights,
        Vec3 ambient_up, Vec3 ambient_down);
  ~World();
  World(World&&) noexcept;

  // Nearest hit with t in (kEpsilon, inf); false if there is none.
  bool Intersect(const Ray& ray, Hit* hit) const;

  // Whether anything that casts shadows lies at t in (kEpsilon, t_max).
  bool Occluded(const Ray& ray, double t_max) const;

  const std::vector<Shape>& shapes() const { return shapes_; }
  const std::vector<Material>& materials() const { return materials_; }
  const std::vector<Light>& lights() const { return lights_; }

  // Light from everywhere that is not a Light, for a surface with this normal.
  Vec3 Ambient(const Vec3& normal) const {
    return Lerp(ambient_down_, ambient_up_, 0.5 + 0.5 * normal.z);
  }

  static constexpr double kEpsilon = 1e-5;  // metres; keeps a surface from shadowing itself

 private:
  std::vector<Shape> shapes_;
  std::vector<Material> materials_;
  std::vector<Light> lights_;
  Vec3 ambient_up_, ambient_down_;
  int room_ = -1;
  std::unique_ptr<Bvh> bvh_;
};

// A room with a laid table. `seed` moves the fine detail of the textures, not the furniture.
World MakeRoom(uint64_t seed);

}  // namespace litags::sample

#endif  // LITAGS_ENGINE_SAMPLE_WORLD_H_
