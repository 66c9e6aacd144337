#include "engine/priors/information.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "engine/core/check.h"
#include "engine/core/mask.h"

namespace litags {
namespace {

constexpr int kCodes = 256;
constexpr int kDifferences = 4 * kCodes;
constexpr int64_t kEnoughSamples = 500;  // of one code

// What the targets do at the samples of one code.
struct CodeStatistics {
  int64_t samples = 0;
  double target_sum = 0;
  std::array<int64_t, kDifferences> differences = {};  // |to the neighbours' mean|, code / 4

  void Add(const CodeStatistics& other) {
    samples += other.samples;
    target_sum += other.target_sum;
    for (int i = 0; i < kDifferences; ++i) differences[i] += other.differences[i];
  }
};

using Statistics = std::vector<CodeStatistics>;  // [kCodes]

void AddPhoto(const ImageU8& photo, const ImageU8& target, const PlaneU8& mask,
              Statistics* statistics) {
  const auto at = [&](int x, int y, int c) -> int {
    return target.data[(size_t(y) * target.width + x) * 3 + c];
  };
  for (int y = 1; y + 1 < photo.height; ++y) {
    for (int x = 1; x + 1 < photo.width; ++x) {
      if (!Counts(mask, x, y)) continue;
      for (int c = 0; c < 3; ++c) {
        const int value = at(x, y, c);
        const int around = at(x - 1, y, c) + at(x + 1, y, c) + at(x, y - 1, c) + at(x, y + 1, c);
        CodeStatistics& s = (*statistics)[photo.data[(size_t(y) * photo.width + x) * 3 + c]];
        s.samples += 1;
        s.target_sum += value;
        s.differences[std::abs(4 * value - around)] += 1;
      }
    }
  }
}

// Deviation of noise whose differences these are.
double NoiseOf(const CodeStatistics& s) {
  int64_t below = 0;
  for (int d = 0; d < kDifferences; ++d) {
    const int64_t next = below + s.differences[d];
    if (4 * next >= s.samples && next > below) {
      const double part = (0.25 * s.samples - below) / (next - below);  // of bin d +- 1/2
      return NoiseOfDifferences(std::max(0.0, d - 0.5 + part) / 4);
    }
    below = next;
  }
  return 0;
}

// The code's statistics with those of as many neighbours as make enough samples.
CodeStatistics Around(const Statistics& statistics, int code) {
  CodeStatistics sum = statistics[code];
  for (int d = 1; d < kCodes && sum.samples < kEnoughSamples; ++d) {
    if (code - d >= 0) sum.Add(statistics[code - d]);
    if (code + d < kCodes) sum.Add(statistics[code + d]);
  }
  return sum;
}

}  // namespace

std::array<double, 256> TargetNoise(absl::Span<const ImageU8* const> photos,
                                    absl::Span<const ImageU8* const> targets,
                                    absl::Span<const PlaneU8> masks) {
  LITAGS_CHECK(photos.size() == targets.size());
  Statistics statistics(kCodes);
  for (size_t i = 0; i < photos.size(); ++i) {
    LITAGS_CHECK(photos[i]->width == targets[i]->width && photos[i]->height == targets[i]->height);
    AddPhoto(*photos[i], *targets[i], MaskOf(masks, i), &statistics);
  }
  std::array<double, 256> noise, mean;
  for (int code = 0; code < kCodes; ++code) {
    const CodeStatistics around = Around(statistics, code);
    noise[code] = NoiseOf(around);
    mean[code] = around.target_sum / std::max<int64_t>(1, around.samples);
  }
  for (int code = 0; code < kCodes; ++code) {
    const int low = std::max(0, code - 1), high = std::min(kCodes - 1, code + 1);
    const double step = std::max(0.0, mean[high] - mean[low]) / (high - low);
    noise[code] = std::max(noise[code], step / std::sqrt(12.0));
    if (code >= kClippedCode) noise[code] = std::max(noise[code], kClippedNoise);
  }
  return noise;
}

double PictureNoise(absl::Span<const ImageU8* const> pictures, absl::Span<const PlaneU8> masks) {
  Statistics statistics(kCodes);
  for (size_t i = 0; i < pictures.size(); ++i) {
    AddPhoto(*pictures[i], *pictures[i], MaskOf(masks, i), &statistics);
  }
  for (int code = 2; code < kCodes; ++code) statistics[1].Add(statistics[code]);
  return NoiseOf(statistics[1]);
}

std::vector<PlaneU8> InformationWeights(absl::Span<const ImageU8* const> photos,
                                        absl::Span<const ImageU8* const> targets,
                                        absl::Span<const PlaneU8> masks) {
  const std::array<double, 256> noise = TargetNoise(photos, targets, masks);
  std::array<double, 256> weight;
  for (int code = 0; code < kCodes; ++code) {
    const double relative = noise[code] / kToleratedNoise;
    weight[code] = 1 / (1 + relative * relative);
  }
  double sum = 0;
  int64_t samples = 0;
  for (size_t i = 0; i < photos.size(); ++i) {
    ForCounted(MaskOf(masks, i), photos[i]->data.size() / 3, [&](size_t k) {
      for (int c = 0; c < 3; ++c) sum += weight[photos[i]->data[3 * k + c]];
      samples += 3;
    });
  }
  const double scale = sum > 0 ? kInformationOne * static_cast<double>(samples) / sum : 0;
  std::vector<PlaneU8> planes;
  for (const ImageU8* photo : photos) {
    PlaneU8& plane = planes.emplace_back(photo->width, photo->height);
    for (size_t i = 0; i < plane.data.size(); ++i) {
      const uint8_t* codes = &photo->data[3 * i];
      const double mean = (weight[codes[0]] + weight[codes[1]] + weight[codes[2]]) / 3;
      plane.data[i] = static_cast<uint8_t>(std::min(255.0, std::round(scale * mean)));
    }
  }
  return planes;
}

}  // namespace litags
