#include "engine/target/clipped_colors.h"

#include <algorithm>
#include <cmath>

#include "engine/core/mask.h"
#include "engine/core/parallel.h"
#include "engine/target/float_image.h"

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

// What a photo shows of a pixel.
struct Sighting {
  Rgb known;      // 1: the channel was measured, 0: it is clipped
  Rgb log_light;  // of clipped channels: white, the least that they may be
};

Sighting SightingOf(const Rgb& codes) {
  Sighting out;
  for (int c = 0; c < 3; ++c) {
    out.known[c] = 1 - Clippedness(codes[c]);
    out.log_light[c] = std::log(LightOf(std::max(codes[c], kDark)));
  }
  return out;
}

// Brings a colour of the palette to the brightness of the pixel. Returns the logarithm of how well
// it then explains what was seen.
float Explain(const Sighting& pixel, Rgb* color) {
  const auto& [known, log_light] = pixel;
  float scale = 0, sum_known = 1e-6f;
  for (int c = 0; c < 3; ++c) {
    scale += known[c] * (log_light[c] - (*color)[c]);
    sum_known += known[c];
  }
  scale /= sum_known;
  float log_weight = Square(scale / kBrightness);
  for (int c = 0; c < 3; ++c) {
    float& scaled = (*color)[c] += scale;
    log_weight += known[c] * Square((log_light[c] - scaled) / kMismatch);
    log_weight += (1 - known[c]) * Square(std::min(scaled, 0.0f) / kUnclipped);
  }
  return -0.5f * log_weight;
}

// The mean of a palette's colours at the brightness of the pixel, by how well they explain it.
Rgb MeanColor(const ScenePalette& palette, float log_exposure, const Sighting& pixel) {
  // A running softmax: `sum` and `mean` are relative to the largest weight so far.
  float largest = -1e30f, sum = 0;
  Rgb mean = {};
  for (Rgb color : palette) {
    for (float& channel : color) channel += log_exposure;
    const float log_weight = Explain(pixel, &color);
    if (log_weight > largest) {
      const float shrink = std::exp(largest - log_weight);
      sum *= shrink;
      for (float& m : mean) m *= shrink;
      largest = log_weight;
    }
    const float weight = std::exp(log_weight - largest);
    sum += weight;
    for (int c = 0; c < 3; ++c) mean[c] += weight * color[c];
  }
  for (float& m : mean) m /= sum;
  return mean;
}

// ClippedColors::LogRatio where nothing is interpolated.
Rgb EstimateLogRatio(const ScenePalette& palette, float log_exposure, const Rgb& codes) {
  const Sighting pixel = SightingOf(codes);
  const bool clipped = std::min({pixel.known[0], pixel.known[1], pixel.known[2]}) < 1;
  Rgb log_light = pixel.log_light;
  if (clipped && !palette.empty()) {
    const Rgb mean = MeanColor(palette, log_exposure, pixel);
    for (int c = 0; c < 3; ++c) {
      if (pixel.known[c] < 1) log_light[c] = std::max(log_light[c], mean[c]);
    }
  }
  float sum = 0;
  for (const float l : log_light) sum += std::exp(l);
  for (float& l : log_light) l -= std::log(sum / 3);
  return log_light;
}

// What a photo shows of the scene in one place.
struct Place {
  Rgb log_light = {};    // 1: the photo's white
  bool clipped = false;  // log_light is the least that it may be
};

// Of every stride-th pixel of a row and of a column, those of which all channels were measured, or
// none.
std::vector<Place> PlacesOf(const Photo& photo, const PlaneU8& mask, const Brightening& brightening,
                            int stride) {
  const FloatImage codes = SmoothCodes(brightening.Undone(photo));
  std::vector<Place> places;
  for (int y = stride / 2; y < codes.rows; y += stride) {
    for (int x = stride / 2; x < codes.cols; x += stride) {
      if (!Counts(mask, x, y)) continue;
      const cv::Vec3f& code = codes(y, x);
      const auto [low, high] = std::minmax({code[0], code[1], code[2]});
      const bool measured = high <= kKnee && LightOf(low) >= kLeastLight;
      const bool clipped = !measured && low > (kKnee + kTop) / 2;
      if (!measured && !clipped) continue;
      const std::array<float, 3> grew = brightening.At(x, y);
      Place place = {.clipped = clipped};
      for (int c = 0; c < 3; ++c) {
        place.log_light[c] = std::log(measured ? LightOf(code[c]) * grew[c] : grew[c]);
      }
      places.push_back(place);
    }
  }
  return places;
}

}  // namespace

float Clippedness(float code) { return SmoothStep((code - kKnee) / (kTop - kKnee)); }

ScenePalette CollectPalette(absl::Span<const Photo> photos, absl::Span<const double> exposures,
                            double gain, absl::Span<const PlaneU8> masks,
                            absl::Span<const Brightening> brightened, int threads,
                            const CancelToken& cancel) {
  std::vector<std::vector<Place>> places(photos.size());
  ParallelFor(threads, photos.size(), [&](size_t i, int) {
    if (cancel.IsCancelled()) return;
    const size_t pixels = photos[i].pixels() * photos.size();
    const int stride = std::ceil(std::sqrt(double(pixels) / kPlaces));
    places[i] = PlacesOf(photos[i], MaskOf(masks, i), BrighteningOf(brightened, i), stride);
  });
  ScenePalette palette;
  double spread = 0;  // in [0, 1), evenly for any number of places
  for (size_t i = 0; i < photos.size(); ++i) {
    const float log_exposure = std::log(exposures[i]);
    const float log_headroom = std::max(0.0, std::log(exposures[i] / gain));
    for (const Place& place : places[i]) {
      if (place.clipped) spread = std::fmod(spread + 0.6180339887, 1.0);
      Rgb color;
      for (int c = 0; c < 3; ++c) {
        float light = place.log_light[c];
        if (place.clipped) {
          light += static_cast<float>(spread) * std::max(0.0f, log_headroom - light);
        }
        color[c] = light - log_exposure;
      }
      palette.push_back(color);
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
