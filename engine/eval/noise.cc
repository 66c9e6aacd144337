#include "engine/eval/noise.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "engine/core/error.h"
#include "engine/core/quantile.h"

namespace litags {
namespace {

constexpr int kGradientRadius = 2;  // px; averaged over a square, so that flat is a region

// px; the residual's mean over a square of this radius is no noise but tone: a wall rendered too
// dark, a curve of another shape. Blotches up to about this size count as noise, as they should:
// they are what smoothing leaves of it.
constexpr int kMeanRadius = 10;

// Sums over the square of `radius` around each pixel, cut at the border; values [height][width].
std::vector<double> BoxSums(const std::vector<double>& values, int width, int height, int radius) {
  // integral(y, x): sum of values above and left of (x, y).
  std::vector<double> integral(size_t(width + 1) * (height + 1));
  const auto at = [&](int y, int x) -> double& { return integral[size_t(y) * (width + 1) + x]; };
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      at(y + 1, x + 1) = values[size_t(y) * width + x] + at(y, x + 1) + at(y + 1, x) - at(y, x);
    }
  }
  std::vector<double> sums(values.size());
  for (int y = 0; y < height; ++y) {
    const int y0 = std::max(0, y - radius), y1 = std::min(height, y + radius + 1);
    for (int x = 0; x < width; ++x) {
      const int x0 = std::max(0, x - radius), x1 = std::min(width, x + radius + 1);
      sums[size_t(y) * width + x] = at(y1, x1) - at(y0, x1) - at(y1, x0) + at(y0, x0);
    }
  }
  return sums;
}

// Squared length of the gradient, summed over channels; one-sided at the border.
std::vector<double> SquaredGradient(const Planes& image) {
  const int w = image.width, h = image.height;
  std::vector<double> out(image.plane_size());
  for (int c = 0; c < image.channels; ++c) {
    for (int y = 0; y < h; ++y) {
      for (int x = 0; x < w; ++x) {
        const int x0 = std::max(0, x - 1), x1 = std::min(w - 1, x + 1);
        const int y0 = std::max(0, y - 1), y1 = std::min(h - 1, y + 1);
        const double dx = (image.at(c, y, x1) - image.at(c, y, x0)) / std::max(1, x1 - x0);
        const double dy = (image.at(c, y1, x) - image.at(c, y0, x)) / std::max(1, y1 - y0);
        out[size_t(y) * w + x] += dx * dx + dy * dy;
      }
    }
  }
  return out;
}

}  // namespace

std::vector<char> FlatPixels(const Planes& clean, double share) {
  const int w = clean.width, h = clean.height;
  std::vector<double> steep = BoxSums(SquaredGradient(clean), w, h, kGradientRadius);
  const std::vector<double> area =
      BoxSums(std::vector<double>(steep.size(), 1.0), w, h, kGradientRadius);
  for (size_t i = 0; i < steep.size(); ++i) steep[i] /= area[i];
  std::vector<char> flat(steep.size());
  if (steep.empty()) return flat;
  std::vector<double> sorted = steep;
  const double most = QuantileInPlace(sorted, std::clamp(share, 0.0, 1.0));
  for (size_t i = 0; i < steep.size(); ++i) flat[i] = steep[i] <= most;
  return flat;
}

absl::StatusOr<double> FlatNoise(const Planes& picture, const Planes& clean,
                                 const std::vector<char>& flat) {
  const size_t n = clean.plane_size();
  if (n == 0 || picture.channels != clean.channels || picture.width != clean.width ||
      picture.height != clean.height || flat.size() != n) {
    return InvalidInput("SIZE_MISMATCH", "picture",
                        "picture: it must have the size of the noise-free one");
  }
  std::vector<double> residual(n);
  const std::vector<double> counts =
      BoxSums({flat.begin(), flat.end()}, clean.width, clean.height, kMeanRadius);
  double squares = 0;
  int64_t samples = 0;
  for (int c = 0; c < clean.channels; ++c) {
    for (size_t i = 0; i < n; ++i) {
      residual[i] = flat[i] ? double(picture.plane(c)[i]) - clean.plane(c)[i] : 0;
    }
    const std::vector<double> sums = BoxSums(residual, clean.width, clean.height, kMeanRadius);
    for (size_t i = 0; i < n; ++i) {
      if (!flat[i]) continue;
      const double r = residual[i] - sums[i] / counts[i];
      squares += r * r;
      ++samples;
    }
  }
  return samples > 0 ? std::sqrt(squares / static_cast<double>(samples)) : 0.0;
}

absl::StatusOr<double> NoiseBetween(const Planes& one, const Planes& other,
                                    const std::vector<char>& flat) {
  LITAGS_ASSIGN_OR_RETURN(const double difference, FlatNoise(one, other, flat));
  return difference / std::sqrt(2.0);
}

}  // namespace litags
