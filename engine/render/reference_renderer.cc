#include "engine/render/reference_renderer.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "engine/render/sh_basis.h"

namespace litags {
namespace {

struct Projected {
  double z, x, y, conic_a, conic_b, conic_c, opacity, dz_dx, dz_dy;
  std::array<double, kNumChannels> features;
};

std::array<double, 9> Product(const std::array<double, 9>& a, const std::array<double, 9>& b) {
  std::array<double, 9> out = {};
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      for (int k = 0; k < 3; ++k) out[3 * i + j] += a[3 * i + k] * b[3 * k + j];
  return out;
}

// False if the Gaussian is before the near plane.
bool ProjectOne(const double* g, const Camera& cam, const RenderSettings& settings,
                Projected* out) {
  const auto p = cam.CamFromWorld({g[0], g[1], g[2]});
  if (!(p[2] > settings.near_plane)) return false;
  double w = g[6], x = g[7], y = g[8], z = g[9];
  const double n = std::sqrt(w * w + x * x + y * y + z * z);
  w /= n, x /= n, y /= n, z /= n;
  const std::array<double, 9> rot = {
      1 - 2 * (y * y + z * z), 2 * (x * y - w * z),     2 * (x * z + w * y),
      2 * (x * y + w * z),     1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
      2 * (x * z - w * y),     2 * (y * z + w * x),     1 - 2 * (x * x + y * y)};
  std::array<double, 9> rs = rot;
  for (int i = 0; i < 9; ++i) rs[i] *= std::exp(g[3 + i % 3]);
  const std::array<double, 9> u = Product(cam.R, rs);
  const double W = cam.width, H = cam.height;
  const double tx = std::clamp(p[0] / p[2], -(cam.cx / cam.fx + 0.15 * W / cam.fx),
                               (W - cam.cx) / cam.fx + 0.15 * W / cam.fx);
  const double ty = std::clamp(p[1] / p[2], -(cam.cy / cam.fy + 0.15 * H / cam.fy),
                               (H - cam.cy) / cam.fy + 0.15 * H / cam.fy);
  const bool mip = settings.pixel_filter == PixelFilter::kMip;
  const double eps = mip ? 0.1 : 0.3;
  double t0[3], t1[3], a = eps, b = 0, c = eps;
  for (int i = 0; i < 3; ++i) {
    t0[i] = cam.fx / p[2] * (u[i] - tx * u[6 + i]);
    t1[i] = cam.fy / p[2] * (u[3 + i] - ty * u[6 + i]);
    a += t0[i] * t0[i];
    b += t0[i] * t1[i];
    c += t1[i] * t1[i];
  }
  const double det = a * c - b * b;
  out->z = p[2];
  out->x = cam.fx * p[0] / p[2] + cam.cx;
  out->y = cam.fy * p[1] / p[2] + cam.cy;
  out->conic_a = c / det;
  out->conic_b = -b / det;
  out->conic_c = a / det;
  double cov_x = 0, cov_y = 0;  // of the mean's pixel and Z
  for (int i = 0; i < 3; ++i) {
    cov_x += t0[i] * u[6 + i];
    cov_y += t1[i] * u[6 + i];
  }
  out->dz_dx = out->conic_a * cov_x + out->conic_b * cov_y;
  out->dz_dy = out->conic_b * cov_x + out->conic_c * cov_y;
  out->opacity = 1 / (1 + std::exp(-g[kLogitOpacity])) / (1 - settings.dropout.share);
  if (mip) out->opacity *= std::sqrt(std::max(0.0, (a - eps) * (c - eps) - b * b) / det);

  const auto center = cam.Center();
  double dir[3] = {g[0] - center[0], g[1] - center[1], g[2] - center[2]};
  const double distance = std::sqrt(dir[0] * dir[0] + dir[1] * dir[1] + dir[2] * dir[2]);
  const auto basis = ShBasis(dir[0] / distance, dir[1] / distance, dir[2] / distance);
  const int terms = (settings.sh_degree + 1) * (settings.sh_degree + 1);
  for (int ch = 0; ch < 3; ++ch) {
    double color = 0.5;
    for (int k = 0; k < terms; ++k) {
      color += basis[k] * g[ShRow(k, ch)];
    }
    out->features[ch] = color * std::pow(settings.lamp.distance / distance, settings.lamp.power);
  }
  out->features[kChannelDepth] = settings.depth_source == DepthSource::kCameraZ ? p[2] : g[kDepth];
  out->features[kChannelStructure] = g[kStructure];
  for (int i = 0; i < 3; ++i) {
    out->features[kChannelNoise + i] = g[kNoise + i];
    out->features[kChannelIllumination + i] = g[kIllumination + i];
  }
  return true;
}

bool Near(double value, double threshold) { return std::abs(value - threshold) < 1e-3 * threshold; }

std::vector<Projected> ProjectAll(const std::vector<double>& params, const Camera& camera,
                                  const RenderSettings& settings) {
  std::vector<Projected> gaussians;
  for (size_t i = 0; i < params.size() / kSplatRows; ++i) {
    if (settings.dropout.LeftOut(i / kSplatBlock) >> i % kSplatBlock & 1) continue;
    Projected p;
    if (ProjectOne(params.data() + i * kSplatRows, camera, settings, &p)) gaussians.push_back(p);
  }
  std::stable_sort(gaussians.begin(), gaussians.end(),
                   [](const Projected& a, const Projected& b) { return a.z < b.z; });
  return gaussians;
}

// One Gaussian's part in a pixel.
struct Part {
  const Projected* gaussian;
  double dx, dy;  // from its mean to the pixel
  double alpha, T;
};

// Front to back. *fragile: see ReferenceImage.
std::vector<Part> PartsOfPixel(const std::vector<Projected>& gaussians, double px, double py,
                               bool* fragile) {
  std::vector<Part> parts;
  *fragile = false;
  double T = 1;
  for (const Projected& g : gaussians) {
    const double dx = px - g.x, dy = py - g.y;
    const double sigma = 0.5 * (g.conic_a * dx * dx + g.conic_c * dy * dy) + g.conic_b * dx * dy;
    const double raw = g.opacity * std::exp(-sigma);
    if (Near(raw, 1.0 / 255) || Near(raw, 0.99)) *fragile = true;
    if (raw < 1.0 / 255) continue;
    const double alpha = std::min(0.99, raw);
    if (Near(T * (1 - alpha), 1e-4)) *fragile = true;
    if (T * (1 - alpha) < 1e-4) break;
    parts.push_back({&g, dx, dy, alpha, T});
    T *= 1 - alpha;
  }
  return parts;
}

// T: behind the last part.
double SurfaceDepth(const std::vector<Part>& parts, double T) {
  if (1 - T <= 1e-3) return 0;
  const bool surface = T < 0.6;
  const double from = surface ? 0.6 : 1, to = surface ? 0.3 : 0;
  double sum = 0, weight = 0;
  for (const Part& part : parts) {
    const double behind = part.T * (1 - part.alpha);
    const double w = std::max(0.0, std::min(part.T, from) - std::max(behind, to));
    const Projected& g = *part.gaussian;
    const double tilt = g.dz_dx * part.dx + g.dz_dy * part.dy;
    sum += w * (g.z + std::clamp(tilt, -0.1 * g.z, 0.1 * g.z));
    weight += w;
  }
  return sum / weight;
}

}  // namespace

std::vector<double> ToDoubles(const Splats& splats) {
  std::vector<double> params(splats.size() * kSplatRows);
  for (size_t i = 0; i < splats.size(); ++i) {
    for (int r = 0; r < kSplatRows; ++r) params[i * kSplatRows + r] = splats.at(i, r);
  }
  return params;
}

ReferenceImage RenderReference(const std::vector<double>& params, const Camera& camera,
                               const RenderSettings& settings) {
  const std::vector<Projected> gaussians = ProjectAll(params, camera, settings);
  const int C = settings.num_channels;
  const size_t plane = size_t(camera.width) * camera.height;
  ReferenceImage out{std::vector<double>(C * plane), std::vector<double>(plane),
                     std::vector<char>(plane), 0};
  for (size_t pixel = 0; pixel < plane; ++pixel) {
    bool fragile;
    double T = 1;
    const std::vector<Part> parts =
        PartsOfPixel(gaussians, pixel % camera.width + 0.5, pixel / camera.width + 0.5, &fragile);
    if (C == kDepthOnly) {
      if (!parts.empty()) T = parts.back().T * (1 - parts.back().alpha);
      out.image[pixel] = SurfaceDepth(parts, T);
      out.fragile[pixel] = fragile;
      out.alpha[pixel] = 1 - T;
      continue;
    }
    for (const Part& part : parts) {
      ++out.contributions;
      for (int c = 0; c < C; ++c) {
        out.image[c * plane + pixel] += part.alpha * part.T * part.gaussian->features[c];
      }
      T = part.T * (1 - part.alpha);
    }
    out.fragile[pixel] = fragile;
    for (int c = 0; c < C; ++c) out.image[c * plane + pixel] += T * settings.background[c];
    out.alpha[pixel] = 1 - T;
  }
  return out;
}

}  // namespace litags
