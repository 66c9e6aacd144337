#include "engine/prior/structure_prior.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/core/mask.h"
#include "engine/core/parallel.h"
#include "engine/core/quantile.h"
#include "engine/noise/noise_estimate.h"
#include "engine/prior/weighted_rows.h"

namespace litags {
namespace {

// LITA-GS Eq. 6: [E, E_l, E_ll] = kColorModel [R, G, B] (Geusebroek et al. 2001).
constexpr float kColorModel[3][3] = {
    {0.06f, 0.63f, 0.27f}, {0.3f, 0.04f, -0.35f}, {0.34f, -0.6f, 0.17f}};

// The floor of E in deviations of its noise: a dark pixel tells nothing of structure.
constexpr double kNoiseFactor = 3;
// Of P > 0, that maps to 1: L1 has one scale for the capture, whatever a few pixels show.
constexpr double kScalePercentile = 99;

struct Kernels {
  int radius = 0;
  std::vector<float> smooth;      // sums to 1
  std::vector<float> derivative;  // correlated: positive where the image grows
};

int KernelRadius(double sigma) { return static_cast<int>(std::ceil(3 * sigma + 0.5)); }

// LITA-GS Eq. 7: f and its derivative.
Kernels MakeKernels(double sigma) {
  Kernels kernels;
  kernels.radius = KernelRadius(sigma);
  std::vector<double> g;
  double sum = 0;
  for (int i = -kernels.radius; i <= kernels.radius; ++i) {
    g.push_back(std::exp(-i * i / (2 * sigma * sigma)));
    sum += g.back();
  }
  for (int i = -kernels.radius; i <= kernels.radius; ++i) {
    const double v = g[i + kernels.radius] / sum;
    kernels.smooth.push_back(static_cast<float>(v));
    kernels.derivative.push_back(static_cast<float>(i / (sigma * sigma) * v));
  }
  return kernels;
}

// Where sample i of n is read: photos are mirrored at their edges, whose samples are not repeated.
// |i| passes the edges by less than n.
int Mirrored(int i, int n) {
  if (i < 0) return -i;
  return i < n ? i : 2 * (n - 1) - i;
}

// Correlation along x of [1, H, W].
Planes AlongX(const Planes& in, const std::vector<float>& kernel) {
  const int radius = static_cast<int>(kernel.size()) / 2, width = in.width;
  Planes out(1, in.height, width);
  std::vector<float> padded(width + 2 * radius);
  std::vector<const float*> taps;
  for (int k = 0; k <= 2 * radius; ++k) taps.push_back(padded.data() + k);
  for (int y = 0; y < in.height; ++y) {
    const float* row = &in.data[size_t(y) * width];
    std::copy_n(row, width, padded.data() + radius);
    for (int k = 1; k <= radius; ++k) {
      padded[radius - k] = row[Mirrored(-k, width)];
      padded[radius + width - 1 + k] = row[Mirrored(width - 1 + k, width)];
    }
    SumWeightedRows(taps, kernel, width, &out.at(0, y, 0));
  }
  return out;
}

// Correlation along y of [1, H, W].
Planes AlongY(const Planes& in, const std::vector<float>& kernel) {
  const int radius = static_cast<int>(kernel.size()) / 2, width = in.width;
  Planes out(1, in.height, width);
  std::vector<const float*> taps(kernel.size());
  for (int y = 0; y < in.height; ++y) {
    for (int k = -radius; k <= radius; ++k) {
      taps[k + radius] = &in.data[size_t(Mirrored(y + k, in.height)) * width];
    }
    SumWeightedRows(taps, kernel, width, &out.at(0, y, 0));
  }
  return out;
}

// LITA-GS Eq. 6, one row; E is measured as it is, so Eq. 2 and Eq. 3 need no code.
Planes ColorModelRow(const Planes& rgb, int row) {
  const float* m = kColorModel[row];
  Planes out(1, rgb.height, rgb.width);
  for (size_t i = 0; i < out.data.size(); ++i) {
    out.data[i] = m[0] * rgb.plane(0)[i] + m[1] * rgb.plane(1)[i] + m[2] * rgb.plane(2)[i];
  }
  return out;
}

// Order-preserving 17-bit code of a value >= 0: 9 bits of its fraction are kept, 0.2%.
constexpr int kDroppedBits = 14;
constexpr size_t kCodes = size_t{1} << (31 - kDroppedBits);
size_t Code(float value) { return std::bit_cast<uint32_t>(value) >> kDroppedBits; }
float CodeValue(size_t code) {
  return std::bit_cast<float>(static_cast<uint32_t>(code << kDroppedBits));
}

// The same in 16 bits, rounded to the nearest: 0.2 %, half a step of a map's bytes at most.
constexpr int kShortDropped = 15;
uint16_t ShortCode(float value) {
  constexpr uint32_t kHalf = 1u << (kShortDropped - 1);
  return static_cast<uint16_t>((std::bit_cast<uint32_t>(value) + kHalf) >> kShortDropped);
}
float ShortCodeValue(size_t code) {
  return std::bit_cast<float>(static_cast<uint32_t>(code << kShortDropped));
}

// The value below which `percentile` % of the counted values lie; 0 of none. Values of 0 do not
// count: a lamp in the dark is all that tells the scale.
double PercentileAbove0(const std::vector<uint64_t>& counts, double percentile) {
  uint64_t total = 0;
  for (size_t code = 1; code < counts.size(); ++code) total += counts[code];
  const double wanted = percentile / 100 * total;
  uint64_t below = 0;
  for (size_t code = 1; code < counts.size(); ++code) {
    below += counts[code];
    if (below >= wanted && counts[code] > 0) return CodeValue(code);
  }
  return 0;
}

}  // namespace

double PriorSigma(int width, int height) { return std::max(0.5, std::max(width, height) / 500.0); }

int LeastPriorSide(int width, int height) { return KernelRadius(PriorSigma(width, height)) + 1; }

absl::StatusOr<Planes> StructurePrior(const Planes& rgb, double sigma_px, double floor) {
  const Kernels kernels = MakeKernels(sigma_px);
  if (rgb.channels != 3 || std::min(rgb.width, rgb.height) <= kernels.radius) {
    return InvalidInput(
        "IMAGE_TOO_SMALL", "image",
        absl::StrCat("structure prior: a photo of ", rgb.width, "x", rgb.height, " px and ",
                     rgb.channels, " channels, must be RGB and more than ", kernels.radius,
                     " px each way; leave it out"));
  }
  Planes prior(1, rgb.height, rgb.width), divisor;
  for (int c = 0; c < 3; ++c) {
    const Planes map = ColorModelRow(rgb, c), smooth = AlongX(map, kernels.smooth);
    const Planes dx = AlongY(AlongX(map, kernels.derivative), kernels.smooth);
    const Planes dy = AlongY(smooth, kernels.derivative);
    if (c == 0) divisor = AlongY(smooth, kernels.smooth);
    for (size_t i = 0; i < prior.data.size(); ++i) {
      prior.data[i] += dx.data[i] * dx.data[i] + dy.data[i] * dy.data[i];
    }
  }
  for (size_t i = 0; i < prior.data.size(); ++i) {
    const float e = std::max(divisor.data[i], static_cast<float>(floor));
    prior.data[i] = e > 0 ? std::sqrt(prior.data[i]) / e : 0.0f;  // no light, no structure
  }
  return prior;
}

double IntensityNoise(const Photo& photo, const PlaneU8& mask) {
  constexpr float kHalfCode = 0.5f / 255;
  const float* m = kColorModel[0];
  // Rounding a code to 8 bits has deviation 1 / (255 sqrt(12)); E mixes three of them.
  const double rounding =
      std::sqrt(double(m[0]) * m[0] + m[1] * m[1] + m[2] * m[2]) / (255 * std::sqrt(12.0));
  const Planes intensity = ColorModelRow(ToPlanes(photo), 0);
  std::vector<float> counted;
  // Black and white have no noise to measure, and would be the median of a night sky or of glare.
  const float white = kBelowWhite * (m[0] + m[1] + m[2]);
  ForCounted(mask, photo.pixels(), [&](size_t i) {
    const float e = intensity.data[i];
    if (e > kHalfCode && e <= white) counted.push_back(e);
  });
  if (counted.empty()) return rounding;
  const NoiseEstimate noise = NoiseOfChannel(intensity.data.data(), photo.width, photo.height, mask,
                                             MedianInPlace(counted));
  return std::max(rounding, noise.Deviation() / 255);
}

double IntensityFloor(absl::Span<const Photo> photos, int threads,
                      absl::Span<const PlaneU8> masks) {
  std::vector<float> noise(photos.size());
  ParallelFor(threads, photos.size(), [&](size_t i, int) {
    noise[i] = static_cast<float>(IntensityNoise(photos[i], MaskOf(masks, i)));
  });
  // E is 1 at most. Stars in black have more noise than light.
  return std::min(1.0, kNoiseFactor * MedianInPlace(noise));
}

absl::StatusOr<CapturePriors> ComputeCapturePriors(absl::Span<const Photo> photos, int threads,
                                                   const CancelToken& cancel,
                                                   absl::Span<const PlaneU8> masks,
                                                   const std::function<void(int)>& done) {
  CapturePriors result;
  result.floor = IntensityFloor(photos, threads, masks);
  if (threads <= 0) threads = DefaultThreadCount();
  std::vector<absl::Status> status(photos.size());
  int largest = 0;
  for (const Photo& photo : photos) largest = std::max({largest, photo.width, photo.height});

  // The scale must be known before values are rounded to bytes. Until then they are kept in 16
  // bits: less than what training holds of a photo later.
  std::vector<std::vector<uint64_t>> counts(threads, std::vector<uint64_t>(kCodes));
  std::vector<std::vector<uint16_t>> codes(photos.size());
  ParallelFor(threads, photos.size(), [&](size_t i, int thread) {
    status[i] = cancel.Check();
    if (!status[i].ok()) return;
    const int width = photos[i].width, height = photos[i].height;
    auto prior = StructurePrior(ToPlanes(photos[i]), PriorSigma(width, height), result.floor);
    status[i] = prior.status();
    if (!prior.ok()) return;
    // Of the same picture, a smaller photo has steeper edges.
    const float slope = static_cast<float>(std::max(width, height)) / static_cast<float>(largest);
    for (float& value : prior->data) value *= slope;
    ForCounted(MaskOf(masks, i), prior->data.size(),
               [&](size_t k) { ++counts[thread][Code(prior->data[k])]; });
    codes[i].resize(prior->data.size());
    std::transform(prior->data.begin(), prior->data.end(), codes[i].begin(), ShortCode);
    if (done) done(thread);
  });
  for (const absl::Status& s : status) LITAGS_RETURN_IF_ERROR(s);
  for (int t = 1; t < threads; ++t) {
    for (size_t code = 0; code < kCodes; ++code) counts[0][code] += counts[t][code];
  }
  result.scale = PercentileAbove0(counts[0], kScalePercentile);
  if (!(result.scale > 0)) {
    return InvalidInput("NO_STRUCTURE", "images",
                        "the photos show no structure at all (all of one colour); take photos with "
                        "some light on the scene, or turn the structure prior off");
  }
  std::vector<uint8_t> bytes(size_t{1} << 16);  // by code
  const float to_byte = static_cast<float>(255 / result.scale);
  for (size_t code = 0; code < bytes.size(); ++code) {
    const float value = ShortCodeValue(code) * to_byte;
    bytes[code] = value < 255 ? static_cast<uint8_t>(value + 0.5f) : 255;  // or NaN, of no value
  }
  result.maps.resize(photos.size());
  ParallelFor(threads, photos.size(), [&](size_t i, int) {
    PlaneU8 map(photos[i].width, photos[i].height);
    std::transform(codes[i].begin(), codes[i].end(), map.data.begin(),
                   [&](uint16_t code) { return bytes[code]; });
    codes[i] = {};
    result.maps[i] = std::move(map);
  });
  return result;
}

}  // namespace litags
