#include "engine/target/lamp_light.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "engine/core/pixel_at.h"

namespace litags {
namespace {

constexpr int kSquares = 24;  // along the longer side

// Gives squares without a point the mean of their neighbours that have one, ring by ring.
void Fill(Planes* light, std::vector<bool> known) {
  const int w = light->width, h = light->height;
  while (std::find(known.begin(), known.end(), false) != known.end()) {
    const std::vector<bool> before = known;
    for (int y = 0; y < h; ++y) {
      for (int x = 0; x < w; ++x) {
        if (before[y * w + x]) continue;
        double sum = 0;
        int n = 0;
        for (int v = std::max(0, y - 1); v <= std::min(h - 1, y + 1); ++v) {
          for (int u = std::max(0, x - 1); u <= std::min(w - 1, x + 1); ++u) {
            if (before[v * w + u]) sum += light->at(0, v, u), ++n;
          }
        }
        if (n == 0) continue;
        light->at(0, y, x) = static_cast<float>(sum / n);
        known[y * w + x] = true;
      }
    }
  }
}

}  // namespace

LampLight::LampLight(absl::Span<const PointSighting> seen, int width, int height)
    : side_(static_cast<double>(std::max(width, height)) / kSquares),
      log_light_(1, std::max(1, static_cast<int>(std::ceil(height / side_))),
                 std::max(1, static_cast<int>(std::ceil(width / side_)))) {
  const int w = log_light_.width, h = log_light_.height;
  std::vector<int> points(size_t(w) * h, 0);
  for (const PointSighting& s : seen) {
    const std::optional<PixelIndex> square = PixelAt(s.x / side_, s.y / side_, w, h);
    if (!square.has_value()) continue;
    log_light_.at(0, square->y, square->x) += static_cast<float>(std::log(s.lit));
    ++points[square->y * w + square->x];
  }
  std::vector<bool> known;
  for (size_t i = 0; i < points.size(); ++i) {
    known.push_back(points[i] > 0);
    if (points[i] > 0) log_light_.data[i] /= static_cast<float>(points[i]);
  }
  if (std::find(known.begin(), known.end(), true) != known.end())
    Fill(&log_light_, std::move(known));
}

double LampLight::At(double x, double y) const {
  const auto square = [&](double at, int most) {
    return std::clamp(static_cast<int>(at / side_), 0, most - 1);
  };
  return std::exp(log_light_.at(0, square(y, log_light_.height), square(x, log_light_.width)));
}

}  // namespace litags
