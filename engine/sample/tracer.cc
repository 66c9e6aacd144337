#include "engine/sample/tracer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include "engine/core/parallel.h"
#include "engine/core/rng.h"

namespace litags::sample {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kAmbientReach = 0.9;  // metres; what is farther away does not block ambient light
constexpr int kAmbientRays = 2;        // a sample
constexpr double kReflectedAmbient = 0.7;  // mean openness assumed for what is seen in a reflection

// Pairs of random numbers a sample may use: its place in the pixel, ambient rays, one for each
// light at the surface and again at what it reflects.
constexpr int kMaxPairs = 16;
using PixelNoise = std::array<std::pair<double, double>, kMaxPairs>;

PixelNoise DrawPixelNoise(const CounterRng& rng, uint64_t pixel) {
  PixelNoise noise;
  for (uint64_t i = 0; i < kMaxPairs; ++i) {
    const uint64_t counter = 2 * (pixel * kMaxPairs + i);
    noise[i] = {rng.Uniform(counter), rng.Uniform(counter + 1)};
  }
  return noise;
}

// Numbers of one picture sample: the R2 sequence (powers of the plastic number), rotated by the
// pixel's noise (Cranley-Patterson), so that the samples of a pixel are well spread in every pair
// of dimensions and neighbouring pixels differ.
class SampleSequence {
 public:
  SampleSequence(const PixelNoise& noise, int sample) : noise_(noise), sample_(sample) {}

  // The next point of the unit square.
  std::pair<double, double> Next() {
    const auto& [u, v] = noise_[next_++ % kMaxPairs];
    return {Fraction(u + 0.7548776662466927 * sample_), Fraction(v + 0.5698402909980532 * sample_)};
  }

 private:
  static double Fraction(double v) { return v - std::floor(v); }

  const PixelNoise& noise_;
  int sample_;
  size_t next_ = 0;
};

// A direction frame around n.
Frame Around(const Vec3& n) {
  const Vec3 side = std::abs(n.z) < 0.9 ? Vec3{0, 0, 1} : Vec3{1, 0, 0};
  const Vec3 ex = Normalized(Cross(side, n));
  return {ex, Cross(n, ex), n};
}

// What a light would give a surface if nothing stood between.
Vec3 OpenIrradiance(const Light& light, const Vec3& point, const Vec3& normal) {
  if (light.kind == Light::Kind::kSphere) {  // exact while the sphere is above the horizon
    const Vec3 to_light = light.center - point;
    const double distance = Length(to_light), ratio = light.radius / distance;
    return light.radiance * (kPi * ratio * ratio * std::max(0.0, Dot(normal, to_light) / distance));
  }
  // Sum over a fixed grid: the same at every sample, so that only penumbras are noisy.
  constexpr int kGrid = 3;
  const Vec3 cross = Cross(light.u, light.v) * (4.0 / (kGrid * kGrid));  // area times normal
  double sum = 0;
  for (int i = 0; i < kGrid * kGrid; ++i) {
    const Vec3 to_light = light.center + light.u * ((i % kGrid + 0.5) * 2 / kGrid - 1) +
                          light.v * ((i / kGrid + 0.5) * 2 / kGrid - 1) - point;
    const double d2 = Dot(to_light, to_light);
    const double surface = Dot(normal, to_light), emitter = -Dot(cross, to_light);
    if (surface > 0 && emitter > 0) sum += surface * emitter / (d2 * d2);
  }
  return light.radiance * sum;
}

// A point of the light, of those that face the surface point.
Vec3 PointOn(const Light& light, const Vec3& point, std::pair<double, double> uv) {
  if (light.kind == Light::Kind::kRectangle) {
    return light.center + light.u * (2 * uv.first - 1) + light.v * (2 * uv.second - 1);
  }
  const Frame frame = Around(Normalized(point - light.center));
  const double r = light.radius * std::sqrt(uv.first), a = 2 * kPi * uv.second;
  return light.center + frame.ex * (r * std::cos(a)) + frame.ey * (r * std::sin(a));
}

// Irradiance from one light, its shadow found by one ray.
Vec3 LightIrradiance(const World& world, const Light& light, const Vec3& point, const Vec3& normal,
                     std::pair<double, double> uv) {
  const Vec3 open = OpenIrradiance(light, point, normal);
  if (open.x + open.y + open.z <= 0) return {};
  const Vec3 to_light = PointOn(light, point, uv) - point;
  const double distance = Length(to_light);
  const Ray shadow{point, to_light * (1 / distance)};
  return world.Occluded(shadow, distance - World::kEpsilon) ? Vec3{} : open;
}

// Share of nearby directions, cosine-weighted, in which nothing is near.
double Openness(const World& world, const Vec3& point, const Vec3& normal,
                SampleSequence* samples) {
  const Frame frame = Around(normal);
  int open = 0;
  for (int i = 0; i < kAmbientRays; ++i) {
    const auto [u, v] = samples->Next();
    const double r = std::sqrt(u), a = 2 * kPi * v;
    const Vec3 local{r * std::cos(a), r * std::sin(a), std::sqrt(1 - u)};
    open += !world.Occluded({point, frame.ToWorld(local)}, kAmbientReach);
  }
  return static_cast<double>(open) / kAmbientRays;
}

// Schlick's approximation for varnish (refractive index 1.5).
double Fresnel(double cosine) {
  const double m = 1 - cosine;
  return 0.04 + 0.96 * m * m * m * m * m;
}

// Radiance arriving along the ray. A reflected ray is not reflected again.
Vec3 Radiance(const World& world, const Ray& ray, bool reflected, SampleSequence* samples) {
  Hit hit;
  if (!world.Intersect(ray, &hit)) return {};
  const Material& material = world.materials()[world.shapes()[hit.shape].material];
  const Vec3 albedo = material.albedo ? material.albedo(hit.local) : Vec3{};
  const Vec3 point = ray.origin + ray.direction * hit.t + hit.normal * World::kEpsilon;

  const double openness =
      reflected ? kReflectedAmbient : Openness(world, point, hit.normal, samples);
  Vec3 irradiance = world.Ambient(hit.normal) * openness;
  for (const Light& light : world.lights()) {
    irradiance += LightIrradiance(world, light, point, hit.normal, samples->Next());
  }
  Vec3 radiance = material.emission + albedo * irradiance * (1 / kPi);
  if (material.gloss > 0 && !reflected) {
    const double cosine = -Dot(hit.normal, ray.direction);
    const Vec3 mirror = ray.direction + hit.normal * (2 * cosine);
    radiance +=
        Radiance(world, {point, mirror}, true, samples) * (material.gloss * Fresnel(cosine));
  }
  return radiance;
}

// The ray along a direction of the camera frame, as long as that.
Ray CameraRay(const Camera& camera, const std::array<double, 3>& d) {
  const auto& R = camera.R;
  return {ToVec3(camera.Center()),
          {R[0] * d[0] + R[3] * d[1] + R[6] * d[2], R[1] * d[0] + R[4] * d[1] + R[7] * d[2],
           R[2] * d[0] + R[5] * d[1] + R[8] * d[2]}};
}

// The ray through the image point (x, y), px, with direction of z length 1 in the camera frame.
Ray PixelRay(const Camera& camera, double x, double y) {
  return CameraRay(camera, camera.Unproject(x, y, 1));
}

}  // namespace

Planes TraceRadiance(const World& world, const Camera& camera, const TraceOptions& options) {
  Planes out(3, camera.height, camera.width);
  const CounterRng rng(options.seed, 0);
  const int grid = options.grid;
  ParallelFor(options.threads, camera.height, [&](size_t y, int) {
    for (int x = 0; x < camera.width; ++x) {
      const PixelNoise noise = DrawPixelNoise(rng, y * camera.width + x);
      Vec3 sum;
      for (int s = 0; s < grid * grid; ++s) {
        SampleSequence samples(noise, s);
        const auto [jx, jy] = samples.Next();
        const double px = x + (s % grid + jx) / grid, py = double(y) + (s / grid + jy) / grid;
        Ray ray;
        if (options.lens) {
          const auto direction = options.lens(px, py);
          if (!direction.has_value()) continue;
          ray = CameraRay(camera, *direction);
        } else {
          ray = PixelRay(camera, px, py);
        }
        ray.direction = Normalized(ray.direction);
        sum += Radiance(world, ray, false, &samples);
      }
      const Vec3 mean = sum * (1.0 / (grid * grid));
      for (int c = 0; c < 3; ++c) out.at(c, static_cast<int>(y), x) = static_cast<float>(mean[c]);
    }
  });
  return out;
}

Planes TraceDepth(const World& world, const Camera& camera, int threads) {
  Planes out(1, camera.height, camera.width);
  ParallelFor(threads, camera.height, [&](size_t y, int) {
    for (int x = 0; x < camera.width; ++x) {
      // The direction's z is 1 in the camera frame, so t is the depth.
      Hit hit;
      const bool found = world.Intersect(PixelRay(camera, x + 0.5, y + 0.5), &hit);
      out.at(0, static_cast<int>(y), x) = found ? static_cast<float>(hit.t) : 0.0f;
    }
  });
  return out;
}

}  // namespace litags::sample
