#include "engine/priors/clipped_colors.h"

#include <algorithm>
#include <cmath>

#include "engine/core/mask.h"
#include "engine/priors/float_image.h"

namespace litags {
namespace {

constexpr float kKnee = 0.95f, kTop = 0.995f;  // codes between which a sample becomes clipped
constexpr int kPlaces = 3000;                  // looked at, in all photos
constexpr float kLeastLight = 0.01f;           // of a channel, for its ratios to be worth something

// Deviations of logarithms, choices measured: between measured channels and a colour of the
// palette; of what should be clipped and is not; of the brightness of a surface.
constexpr float kMismatch = 0.2f, kUnclipped = 0.05f, kBrightness = 0.8f;

constexpr int kKneeNode = 12;   // of the node at code kKnee, in ClippedColors
constexpr float kDark = 0.03f;  // codes below have the colours of this one

float Square(float x) { return x * x; }

float LightOf(float code) { return static_cast<float>(LinearFromSrgb(code)); }

// What a pixel of these codes has in the mean of the palette; see ClippedColors.
Rgb EstimateLogRatio(const ScenePalette& palette, float log_exposure, const Rgb& codes) {
  Rgb known, log_light;
  for (int c = 0; c < 3; ++c) {
    known[c] = 1 - Clippedness(codes[c]);
    log_light[c] = std::log(LightOf(std::max(codes[c], kDark)));
  }
  const float sum_known = known[0] + known[1] + known[2] + 1e-6f;
  // A running softmax: `sum` and `mean` are relative to the largest weight so far.
  float largest = -1e30f, sum = 0;
  Rgb mean = {};
  if (sum_known < 3) {
    for (const Rgb& color : palette) {
      Rgb difference;
      float scale = 0;  // log of what brings the colour to the pixel's brightness
      for (int c = 0; c < 3; ++c) {
        difference[c] = log_light[c] - (color[c] + log_exposure);
        scale += known[c] * difference[c] / sum_known;
      }
      Rgb scaled;
      float log_weight = -0.5f * Square(scale / kBrightness);
      for (int c = 0; c < 3; ++c) {
        scaled[c] = color[c] + log_exposure + scale;
        log_weight -= 0.5f * known[c] * Square((difference[c] - scale) / kMismatch);
        log_weight -= 0.5f * (1 - known[c]) * Square(std::min(scaled[c], 0.0f) / kUnclipped);
      }
      if (log_weight > largest) {
        const float shrink = std::exp(largest - log_weight);
        sum *= shrink;
        for (float& m : mean) m *= shrink;
        largest = log_weight;
      }
      const float weight = std::exp(log_weight - largest);
      sum += weight;
      for (int c = 0; c < 3; ++c) mean[c] += weight * scaled[c];
    }
  }
  Rgb log_ratio;
  float light = 0;
  for (int c = 0; c < 3; ++c) {
    const bool measured = known[c] == 1 || sum == 0;
    log_ratio[c] = measured ? log_light[c] : std::max(log_light[c], mean[c] / sum);
    light += std::exp(log_ratio[c]);
  }
  for (float& r : log_ratio) r -= std::log(light / 3);
  return log_ratio;
}

}  // namespace

float Clippedness(float code) {
  const float x = std::clamp((code - kKnee) / (kTop - kKnee), 0.0f, 1.0f);
  return x * x * (3 - 2 * x);
}

ScenePalette CollectPalette(absl::Span<const ImageU8> photos, absl::Span<const double> exposures,
                            double gain, absl::Span<const PlaneU8> masks) {
  ScenePalette palette;
  double spread = 0;  // in [0, 1), evenly for any number of places
  for (size_t i = 0; i < photos.size(); ++i) {
    const FloatImage codes = SmoothCodes(photos[i]);
    const float log_exposure = std::log(exposures[i]);
    const float log_headroom = std::max(0.0, std::log(exposures[i] / gain));
    const int stride = std::ceil(std::sqrt(double(codes.total()) * photos.size() / kPlaces));
    for (int y = stride / 2; y < codes.rows; y += stride) {
      for (int x = stride / 2; x < codes.cols; x += stride) {
        if (!Counts(MaskOf(masks, i), x, y)) continue;
        const cv::Vec3f& code = codes(y, x);
        const auto [low, high] = std::minmax({code[0], code[1], code[2]});
        Rgb color;
        if (high <= kKnee && LightOf(low) >= kLeastLight) {
          for (int c = 0; c < 3; ++c) color[c] = std::log(LightOf(code[c])) - log_exposure;
        } else if (low > (kKnee + kTop) / 2) {
          spread = std::fmod(spread + 0.6180339887, 1.0);
          color.fill(static_cast<float>(spread) * log_headroom - log_exposure);
        } else {
          continue;
        }
        palette.push_back(color);
      }
    }
  }
  return palette;
}

ClippedColors::ClippedColors(const ScenePalette& palette, double exposure) {
  const auto code = [](int node) {
    return node <= kKneeNode ? kKnee * node / kKneeNode
                             : kKnee + (1 - kKnee) * (node - kKneeNode) / (kNodes - 1 - kKneeNode);
  };
  table_.reserve(kNodes * kNodes * kNodes);
  for (int r = 0; r < kNodes; ++r) {
    for (int g = 0; g < kNodes; ++g) {
      for (int b = 0; b < kNodes; ++b) {
        const Rgb codes = {code(r), code(g), code(b)};
        table_.push_back(EstimateLogRatio(palette, std::log(exposure), codes));
      }
    }
  }
}

Rgb ClippedColors::LogRatio(const Rgb& codes) const {
  std::array<int, 3> node;
  Rgb f;
  for (int c = 0; c < 3; ++c) {
    const float code = std::clamp(codes[c], 0.0f, 1.0f);
    const float position =
        code <= kKnee ? code / kKnee * kKneeNode
                      : kKneeNode + (code - kKnee) / (1 - kKnee) * (kNodes - 1 - kKneeNode);
    node[c] = std::min(static_cast<int>(position), kNodes - 2);
    f[c] = position - node[c];
  }
  Rgb log_ratio = {};
  for (int corner = 0; corner < 8; ++corner) {
    const int r = corner & 1, g = corner >> 1 & 1, b = corner >> 2;
    const float weight = (r ? f[0] : 1 - f[0]) * (g ? f[1] : 1 - f[1]) * (b ? f[2] : 1 - f[2]);
    const Rgb& value = Node(node[0] + r, node[1] + g, node[2] + b);
    for (int c = 0; c < 3; ++c) log_ratio[c] += weight * value[c];
  }
  return log_ratio;
}

}  // namespace litags
