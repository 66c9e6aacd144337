#include "engine/target/information.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <utility>

#include "engine/core/check.h"
#include "engine/core/mask.h"
#include "engine/core/parallel.h"
#include "engine/noise/noise_estimate.h"

namespace litags {
namespace {

constexpr int kCodes = 256;
constexpr int64_t kEnoughSamples = 500;  // of one code

// The 8-bit code of a sample.
int CodeOf(int16_t sample) {
  return std::clamp(static_cast<int>(std::lrint(sample / kPhotoCode)), 0, kCodes - 1);
}

// What the targets do at the samples of one code; whole numbers, so that sums do not depend on
// their order.
struct CodeSamples {
  int64_t samples = 0;
  int64_t target_sum = 0;  // of samples
  NoiseEstimate noise;

  void Add(const CodeSamples& other) {
    samples += other.samples;
    target_sum += other.target_sum;
    noise.Add(other.noise);
  }
};

using Samples = std::vector<CodeSamples>;  // [kCodes]

void AddPhoto(const Photo& photo, const Photo& target, const PlaneU8& mask, Samples* samples) {
  LITAGS_CHECK(photo.width == target.width && photo.height == target.height);
  ForEachDifference(target, mask, [&](size_t sample, float magnitude) {
    CodeSamples& s = (*samples)[CodeOf(photo.data[sample])];
    s.samples += 1;
    s.target_sum += target.data[sample];
    s.noise.AddDifference(magnitude);
  });
}

// The code's samples with those of as many neighbours, clipped as it is or not, as make enough.
CodeSamples Around(const Samples& samples, int code) {
  const int begin = code < kClippedCode ? 0 : kClippedCode;
  const int end = code < kClippedCode ? kClippedCode : kCodes;
  CodeSamples sum = samples[code];
  for (int d = 1; d < kCodes && sum.samples < kEnoughSamples; ++d) {
    if (code - d >= begin) sum.Add(samples[code - d]);
    if (code + d < end) sum.Add(samples[code + d]);
  }
  return sum;
}

// Of the targets where their photos have each code; codes of 255.
struct CodeStatistics {
  std::array<double, kCodes> mean;
  // Standard deviation of the target's error, the larger of two: the noise measured in the targets
  // (engine/noise); and that of rounding the photo to its file's codes, the target's step from one
  // to the next / sqrt(12). Clipped highlights have kClippedNoise or more.
  std::array<double, kCodes> noise;
};

// Codes that hardly occur take over their neighbours'.
CodeStatistics Summarize(const Samples& samples, double code_step) {
  CodeStatistics out;
  for (int code = 0; code < kCodes; ++code) {
    const CodeSamples around = Around(samples, code);
    out.noise[code] = around.noise.Deviation();
    const auto samples_of_code = static_cast<double>(std::max<int64_t>(1, around.samples));
    out.mean[code] = static_cast<double>(around.target_sum) / kPhotoCode / samples_of_code;
  }
  for (int code = 0; code < kCodes; ++code) {
    const int low = std::max(0, code - 1), high = std::min(kCodes - 1, code + 1);
    const double step = std::max(0.0, out.mean[high] - out.mean[low]) / (high - low);
    double& noise = out.noise[code];
    noise = std::max(noise, code_step * step / std::sqrt(12.0));
    if (code >= kClippedCode) noise = std::max(noise, kClippedNoise);
  }
  return out;
}

// The noise of a target of each code, by what photos of one exposure say.
std::array<double, kCodes> NoiseOfTargets(const CodeStatistics& photos) {
  std::array<double, kCodes> noise;
  int code = 0;
  for (int target = 0; target < kCodes; ++target) {
    while (code + 1 < kCodes && photos.mean[code] < target) ++code;
    noise[target] = photos.noise[code];
  }
  return noise;
}

// Of one sample, by the codes of its photo and its target: [kCodes * photo + target].
using WeightTable = std::vector<float>;

WeightTable WeightsOf(const std::array<double, kCodes>& noise,
                      const std::array<double, kCodes>& best) {
  const auto spread = [](double noise) {
    return 1 + noise * noise / (kToleratedNoise * kToleratedNoise);
  };
  WeightTable weights;
  for (int code = 0; code < kCodes; ++code) {
    for (int target = 0; target < kCodes; ++target) {
      weights.push_back(std::min(1.0, spread(best[target]) / spread(noise[code])));
    }
  }
  return weights;
}

// A photo as its camera stored it: whether a sample is clipped is told by that.
class StoredPhoto {
 public:
  StoredPhoto(const Photo& photo, const Brightening& brightening)
      : photo_(photo), undone_(brightening.none() ? Photo() : brightening.Undone(photo)) {}
  const Photo& operator*() const { return undone_.empty() ? photo_ : undone_; }

 private:
  const Photo& photo_;
  const Photo undone_;
};

// Of some of the photos, by their indices.
Samples SamplesOf(absl::Span<const Photo* const> photos, absl::Span<const Photo* const> targets,
                  absl::Span<const PlaneU8> masks, absl::Span<const Brightening> brightened,
                  absl::Span<const size_t> indices, int threads, const CancelToken& cancel) {
  if (threads <= 0) threads = DefaultThreadCount();
  std::vector<Samples> of_threads(threads);
  ParallelFor(threads, indices.size(), [&](size_t k, int thread) {
    if (cancel.IsCancelled()) return;
    Samples& samples = of_threads[thread];
    samples.resize(kCodes);
    const size_t i = indices[k];
    const StoredPhoto stored(*photos[i], BrighteningOf(brightened, i));
    AddPhoto(*stored, *targets[i], MaskOf(masks, i), &samples);
  });
  Samples sum(kCodes);
  for (const Samples& samples : of_threads) {
    for (size_t code = 0; code < samples.size(); ++code) sum[code].Add(samples[code]);
  }
  return sum;
}

// Photos are taken together by exposure.
int HalfStops(double exposure) { return static_cast<int>(std::lround(2 * std::log2(exposure))); }

std::map<int, WeightTable> TablesByExposure(absl::Span<const Photo* const> photos,
                                            absl::Span<const Photo* const> targets,
                                            absl::Span<const double> exposures,
                                            absl::Span<const PlaneU8> masks,
                                            absl::Span<const Brightening> brightened,
                                            double code_step, int threads,
                                            const CancelToken& cancel) {
  std::map<int, std::vector<size_t>> groups;
  for (size_t i = 0; i < photos.size(); ++i) groups[HalfStops(exposures[i])].push_back(i);
  std::map<int, CodeStatistics> statistics;
  std::array<double, kCodes> best;
  best.fill(kClippedNoise);
  for (const auto& [exposure, group] : groups) {
    statistics[exposure] =
        Summarize(SamplesOf(photos, targets, masks, brightened, group, threads, cancel), code_step);
    const std::array<double, kCodes> noise = NoiseOfTargets(statistics[exposure]);
    for (int code = 0; code < kCodes; ++code) best[code] = std::min(best[code], noise[code]);
  }
  std::map<int, WeightTable> tables;
  for (const auto& [exposure, codes] : statistics) tables[exposure] = WeightsOf(codes.noise, best);
  return tables;
}

}  // namespace

std::vector<PlaneU8> InformationWeights(absl::Span<const Photo* const> photos,
                                        absl::Span<const Photo* const> targets,
                                        absl::Span<const double> exposures,
                                        absl::Span<const PlaneU8> masks,
                                        absl::Span<const Brightening> brightened, double code_step,
                                        int threads, const CancelToken& cancel) {
  LITAGS_CHECK(targets.size() == photos.size() && exposures.size() == photos.size());
  if (photos.empty()) return {};
  const auto [least, most] = std::minmax_element(exposures.begin(), exposures.end());
  if (*most <= kLikeExposures * *least) return {};

  const std::map<int, WeightTable> tables =
      TablesByExposure(photos, targets, exposures, masks, brightened, code_step, threads, cancel);
  const auto weight = [](const WeightTable& table, const Photo& photo, const Photo& target,
                         size_t pixel) {
    double sum = 0;
    for (size_t k = 3 * pixel; k < 3 * pixel + 3; ++k) {
      sum += table[kCodes * CodeOf(photo.data[k]) + CodeOf(target.data[k])];
    }
    return sum / 3;
  };
  std::vector<double> sums(photos.size());
  ParallelFor(threads, photos.size(), [&](size_t i, int) {
    if (cancel.IsCancelled()) return;
    const WeightTable& table = tables.at(HalfStops(exposures[i]));
    const StoredPhoto stored(*photos[i], BrighteningOf(brightened, i));
    ForCounted(MaskOf(masks, i), photos[i]->pixels(),
               [&](size_t k) { sums[i] += weight(table, *stored, *targets[i], k); });
  });
  double sum = 0;
  size_t pixels = 0;
  for (size_t i = 0; i < photos.size(); ++i) {
    sum += sums[i];
    pixels += CountedPixels(MaskOf(masks, i), photos[i]->pixels());
  }
  const double scale = sum > 0 ? kInformationOne * static_cast<double>(pixels) / sum : 0;
  std::vector<PlaneU8> planes(photos.size());
  ParallelFor(threads, photos.size(), [&](size_t i, int) {
    if (cancel.IsCancelled()) return;
    const WeightTable& table = tables.at(HalfStops(exposures[i]));
    const StoredPhoto stored(*photos[i], BrighteningOf(brightened, i));
    PlaneU8 plane(photos[i]->width, photos[i]->height);
    for (size_t k = 0; k < plane.data.size(); ++k) {
      const double w = weight(table, *stored, *targets[i], k);
      plane.data[k] = static_cast<uint8_t>(std::min(255.0, std::round(scale * w)));
    }
    planes[i] = std::move(plane);
  });
  if (cancel.IsCancelled()) return {};
  return planes;
}

}  // namespace litags
