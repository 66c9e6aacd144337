#include "engine/sample/texture.h"

#include <array>
#include <cmath>
#include <numbers>

#include "engine/core/color.h"

namespace litags::sample {
namespace {

constexpr double kPi = std::numbers::pi;

double SmoothStep(double a, double b, double v) {
  const double t = std::clamp((v - a) / (b - a), 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

double Fraction(double v) { return v - std::floor(v); }

double ValueNoise(const Vec3& p, uint64_t seed) {
  const double fx = std::floor(p.x), fy = std::floor(p.y), fz = std::floor(p.z);
  const int x = static_cast<int>(fx), y = static_cast<int>(fy), z = static_cast<int>(fz);
  const auto fade = [](double t) { return t * t * (3 - 2 * t); };
  const double u = fade(p.x - fx), v = fade(p.y - fy), w = fade(p.z - fz);
  const auto row = [&](int j, int k) {
    const double a = CellNoise(x, y + j, z + k, seed), b = CellNoise(x + 1, y + j, z + k, seed);
    return a + (b - a) * u;
  };
  const double near = row(0, 0) + (row(1, 0) - row(0, 0)) * v;
  const double far = row(0, 1) + (row(1, 1) - row(0, 1)) * v;
  return near + (far - near) * w;
}

// Relative brightness around 1 with features of `size` metres and below.
double Mottle(const Vec3& p, double size, double amount, uint64_t seed) {
  return 1 + amount * 2 * (Noise(p * (1 / size), 3, seed) - 0.5);
}

// The nearest of one jittered point a cell (Worley's noise): its distance, and a number in [0, 1)
// of its own.
struct CellHit {
  double distance;
  double id;
};
CellHit NearestCell(const Vec3& p, uint64_t seed) {
  const int x = static_cast<int>(std::floor(p.x)), y = static_cast<int>(std::floor(p.y)),
            z = static_cast<int>(std::floor(p.z));
  double nearest = 1e9, id = 0;
  for (int i = x - 1; i <= x + 1; ++i) {
    for (int j = y - 1; j <= y + 1; ++j) {
      for (int k = z - 1; k <= z + 1; ++k) {
        // One hash a cell: its bits are the three offsets, and all of them the cell's own number.
        const double h = CellNoise(i, j, k, seed);
        const double dx = i + h - p.x, dy = j + Fraction(h * 1024) - p.y,
                     dz = k + Fraction(h * 1048576) - p.z;
        const double d = dx * dx + dy * dy + dz * dz;
        if (d < nearest) nearest = d, id = h;
      }
    }
  }
  return {std::sqrt(nearest), Fraction(id * 32768)};
}

const Vec3& Pick(const std::vector<Vec3>& palette, double id) {
  return palette[static_cast<size_t>(id * palette.size()) % palette.size()];
}

}  // namespace

Vec3 Rgb(uint32_t srgb) {
  const auto channel = [&](int shift) { return LinearFromSrgb(((srgb >> shift) & 255) / 255.0); };
  return {channel(16), channel(8), channel(0)};
}

double CellNoise(int x, int y, int z, uint64_t seed) {
  uint64_t h = seed * 0x9E3779B97F4A7C15ull + static_cast<uint32_t>(x) * 0x8DA6B343ull +
               static_cast<uint32_t>(y) * 0xD8163841ull * 31 +
               static_cast<uint32_t>(z) * 0xCB1AB31Full * 1009;
  h = (h ^ (h >> 32)) * 0xD6E8FEB86659FD93ull;
  h = (h ^ (h >> 32)) * 0xD6E8FEB86659FD93ull;
  return static_cast<double>((h ^ (h >> 32)) & 0xFFFFFFFF) * 0x1.0p-32;
}

double Noise(const Vec3& p, int octaves, uint64_t seed) {
  double sum = 0, weight = 1, total = 0, scale = 1;
  for (int i = 0; i < octaves; ++i) {
    sum += weight * ValueNoise(p * scale, seed + i);
    total += weight;
    weight *= 0.5;
    scale *= 2.03;  // not 2, so that the lattices of the octaves do not coincide
  }
  return sum / total;
}

std::pair<double, double> FaceUv(const SurfacePoint& point) {
  const Vec3 &p = point.position, &n = point.normal;
  if (std::abs(n.z) > 0.5) return {p.x, p.y};
  if (std::abs(n.y) > 0.5) return {p.x, p.z};
  return {p.y, p.z};
}

Texture Speckled(Vec3 color, double amount, uint64_t seed) {
  return [=](const SurfacePoint& s) {
    return color * (Mottle(s.position, 0.35, amount * 0.8, seed) *
                    Mottle(s.position, 0.035, amount, seed + 10));
  };
}

Texture Wood(Vec3 light, Vec3 dark, uint64_t seed) {
  return [=](const SurfacePoint& s) {
    const Vec3& p = s.position;
    const double bend = Noise({p.x * 1.5, p.y * 5, p.z * 5}, 3, seed);
    const double ring = 0.5 + 0.5 * std::sin(60 * bend + 25 * p.y);
    const double fibre = Noise({p.x * 14, p.y * 150, p.z * 150}, 2, seed + 10);
    const double knot = SmoothStep(0.10, 0.03, NearestCell(p * 3.1, seed + 20).distance);
    const double t = std::clamp(0.45 * ring + 0.7 * fibre - 0.1 - 0.6 * knot, 0.0, 1.0);
    return Lerp(dark, light, t);
  };
}

Texture Planks(Vec3 light, Vec3 dark, double width, uint64_t seed) {
  return [=](const SurfacePoint& s) {
    const auto [u, v] = FaceUv(s);
    const int board = static_cast<int>(std::floor(v / width));
    const double across = v / width - board;
    const double along = u / 1.1 + CellNoise(board, 0, 0, seed);
    const int piece = static_cast<int>(std::floor(along));
    const double tint = CellNoise(board, piece, 1, seed);
    const Vec3 grain{u * 9 + 17 * tint, v * 90, 31 * tint};
    const double t = 0.25 + 0.45 * tint + 0.9 * (Noise(grain, 3, seed + 5) - 0.5);
    const double edge = std::min(
        {across, 1 - across, (along - piece) * 1.1 / width, (1 - along + piece) * 1.1 / width});
    const double gap = 0.35 + 0.65 * SmoothStep(0.0, 0.04, edge);
    return Lerp(dark, light, std::clamp(t, 0.0, 1.0)) * gap;
  };
}

Texture Bricks(Vec3 brick, Vec3 mortar, uint64_t seed) {
  return [=](const SurfacePoint& s) {
    constexpr double kHeight = 0.085, kWidth = 0.25, kJoint = 0.011;
    const auto [u, v] = FaceUv(s);
    const int course = static_cast<int>(std::floor(v / kHeight));
    const double along = u + (course % 2 ? 0.5 * kWidth : 0) + 0.04 * CellNoise(course, 7, 0, seed);
    const int index = static_cast<int>(std::floor(along / kWidth));
    const double wobble = 0.004 * (Noise(s.position * 40, 2, seed + 3) - 0.5);
    const double edge = std::min({v - course * kHeight, (course + 1) * kHeight - v,
                                  along - index * kWidth, (index + 1) * kWidth - along});
    const double face = SmoothStep(kJoint * 0.5, kJoint * 0.5 + 0.004, edge + wobble);
    const double tint = 0.6 + 0.8 * CellNoise(course, index, 0, seed);
    const double hue = CellNoise(course, index, 1, seed) - 0.5;
    const Vec3 fired = brick * tint * Vec3{1 + 0.2 * hue, 1.0, 1 - 0.25 * hue};
    return Lerp(mortar, fired, face) * Mottle(s.position, 0.03, 0.55, seed + 10);
  };
}

Texture Terrazzo(Vec3 ground, std::vector<Vec3> palette, double cell, uint64_t seed) {
  return [=](const SurfacePoint& s) {
    const CellHit hit = NearestCell(s.position * (1 / cell), seed);
    const double inside = SmoothStep(0.55, 0.45, hit.distance + 0.25 * hit.id);
    return Lerp(ground, Pick(palette, hit.id), inside) * Mottle(s.position, 0.02, 0.25, seed + 9);
  };
}

Texture Marble(Vec3 ground, Vec3 vein, double scale, uint64_t seed) {
  return [=](const SurfacePoint& s) {
    const Vec3 p = s.position * (1 / scale);
    const double warp = Noise(p * 2.0, 4, seed);
    const double wave = std::abs(std::sin(3 * p.x + 2 * p.z + 9 * warp));
    const double t = SmoothStep(0.35, 0.0, wave) * (0.4 + 0.6 * Noise(p * 6, 2, seed + 8));
    return Lerp(ground * (0.75 + 0.4 * warp), vein, t);
  };
}

Texture BeachBall(std::vector<Vec3> colors, Vec3 cap, int segments, uint64_t seed) {
  return [=](const SurfacePoint& s) {
    const double angle = std::atan2(s.normal.y, s.normal.x) / (2 * kPi) + 0.5;
    const int segment = std::min(static_cast<int>(angle * segments), segments - 1);
    const Vec3& color = std::abs(s.normal.z) > 0.95 ? cap : colors[segment % colors.size()];
    return color * Mottle(s.position, 0.03, 0.25, seed);
  };
}

Texture Rings(std::vector<Vec3> colors, double width, uint64_t seed) {
  return [=](const SurfacePoint& s) {
    const double wave = 0.25 * std::sin(10 * std::atan2(s.normal.y, s.normal.x));
    const int ring = static_cast<int>(std::floor(s.position.z / width + 100 + wave));
    return colors[ring % colors.size()] * Mottle(s.position, 0.025, 0.3, seed);
  };
}

Texture Rug(double half_x, double half_y, uint64_t seed) {
  const std::array<Vec3, 5> wool = {Rgb(0x8E2B2B), Rgb(0x23395B), Rgb(0xD9A441), Rgb(0xE8DCC4),
                                    Rgb(0x3F6B5C)};
  return [=](const SurfacePoint& s) {
    const double u = s.position.x, v = s.position.y;
    const double rim = std::min(half_x - std::abs(u), half_y - std::abs(v));
    size_t color;
    if (rim < 0.03) {
      color = 3;
    } else if (rim < 0.14) {  // a band of small triangles
      const double along = half_x - std::abs(u) < half_y - std::abs(v) ? v : u;
      const double tooth = std::abs(std::fmod(along + 10, 0.12) / 0.12 - 0.5) * 2;
      color = tooth > (rim - 0.03) / 0.11 ? 1 : 2;
    } else {
      const double du = u / 0.36, dv = v / 0.30;
      const int cell =
          static_cast<int>(std::floor(du + 50)) + static_cast<int>(std::floor(dv + 50));
      const double diamond =
          std::abs(du - std::floor(du) - 0.5) + std::abs(dv - std::floor(dv) - 0.5);
      color = diamond < 0.14 ? 3 : diamond < 0.24 ? 1 : diamond < 0.36 ? 2 + 2 * (cell % 2) : 0;
    }
    const double weave = 0.75 + 0.5 * CellNoise(static_cast<int>(std::floor(u / 0.009)),
                                                static_cast<int>(std::floor(v / 0.014)), 0, seed);
    return wool[color] * (weave * Mottle(s.position, 0.12, 0.3, seed + 1));
  };
}

Texture Book(Vec3 cover, Vec3 band, int pages_axis, uint64_t seed) {
  return [=](const SurfacePoint& s) {
    const Vec3& p = s.position;
    if (std::abs(s.normal[pages_axis]) > 0.5) {
      const double sheet = CellNoise(static_cast<int>(std::floor(p.z / 0.002)),
                                     static_cast<int>(std::floor(p.y / 0.002)), 0, seed);
      return Rgb(0xE9DFC6) * (0.7 + 0.3 * sheet);
    }
    const auto [u, v] = FaceUv(s);
    const int line = static_cast<int>(std::floor(v / 0.02 + 100));
    const int letter = static_cast<int>(std::floor(u / 0.008 + 1000));
    const bool written = line % 3 == 0 && CellNoise(letter, line, 0, seed) > 0.45;
    const bool rule = CellNoise(line, 0, 5, seed) > 0.82;
    return (written || rule ? band : cover) * Mottle(p, 0.025, 0.3, seed + 2);
  };
}

Texture Picture(ImageU8 image, double half_x, double half_z, Vec3 side) {
  std::vector<Vec3> texels(static_cast<size_t>(image.width) * image.height);
  for (size_t i = 0; i < texels.size(); ++i) {
    const uint8_t* rgb = image.data.data() + 3 * i;
    texels[i] = Rgb(uint32_t{rgb[0]} << 16 | uint32_t{rgb[1]} << 8 | rgb[2]);
  }
  const int w = image.width, h = image.height;
  return [=, texels = std::move(texels)](const SurfacePoint& s) {
    if (s.normal.y > -0.5) return side;
    const double x = std::clamp((s.position.x / half_x + 1) * 0.5 * w - 0.5, 0.0, w - 1.001);
    const double y = std::clamp((1 - s.position.z / half_z) * 0.5 * h - 0.5, 0.0, h - 1.001);
    const int i = static_cast<int>(x), j = static_cast<int>(y);
    const Vec3* row = texels.data() + static_cast<size_t>(j) * w + i;
    return Lerp(Lerp(row[0], row[1], x - i), Lerp(row[w], row[w + 1], x - i), y - j);
  };
}

}  // namespace litags::sample
