#include "engine/priors/information.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>

#include "engine/core/check.h"
#include "engine/core/mask.h"

namespace litags {
namespace {

constexpr int kCodes = 256;
constexpr int64_t kEnoughSamples = 500;  // of one code

void AddCounts(const NoiseDifferences& from, NoiseDifferences* to) {
  for (size_t i = 0; i < from.size(); ++i) (*to)[i] += from[i];
}

// What the targets do at the samples of one code.
struct CodeStatistics {
  int64_t samples = 0;
  double target_sum = 0;
  NoiseDifferences differences = {};

  void Add(const CodeStatistics& other) {
    samples += other.samples;
    target_sum += other.target_sum;
    AddCounts(other.differences, &differences);
  }
};

using Statistics = std::vector<CodeStatistics>;  // [kCodes]

// Calls visit(sample, code, difference) for every sample of the picture but the border's: its index
// in the data, and the difference as NoiseDifferences counts it.
template <class Visit>
void ForEachDifference(const ImageU8& picture, const PlaneU8& mask, const Visit& visit) {
  const size_t row = 3 * size_t(picture.width);
  for (int y = 1; y + 1 < picture.height; ++y) {
    for (int x = 1; x + 1 < picture.width; ++x) {
      if (!Counts(mask, x, y)) continue;
      for (int c = 0; c < 3; ++c) {
        const size_t sample = y * row + 3 * x + c;
        const uint8_t* at = picture.data.data() + sample;
        visit(sample, *at, std::abs(4 * *at - (at[-3] + at[3] + *(at - row) + at[row])));
      }
    }
  }
}

void AddPhoto(const ImageU8& photo, const ImageU8& target, const PlaneU8& mask,
              Statistics* statistics) {
  ForEachDifference(target, mask, [&](size_t sample, int code, int difference) {
    CodeStatistics& s = (*statistics)[photo.data[sample]];
    s.samples += 1;
    s.target_sum += code;
    s.differences[difference] += 1;
  });
}

// Deviation of noise whose differences these are.
double NoiseOf(const NoiseDifferences& differences) {
  const int64_t samples = std::accumulate(differences.begin(), differences.end(), int64_t{0});
  int64_t below = 0;
  for (size_t d = 0; d < differences.size(); ++d) {
    const int64_t next = below + differences[d];
    if (4 * next >= samples && next > below) {
      const double part = (0.25 * samples - below) / (next - below);  // of bin d +- 1/2
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
    noise[code] = NoiseOf(around.differences);
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

void PictureNoise::Add(const ImageU8& picture, const PlaneU8& mask) {
  ForEachDifference(picture, mask, [&](size_t, int code, int difference) {
    if (code > 0) differences_[difference] += 1;
  });
}

void PictureNoise::Add(const PictureNoise& other) { AddCounts(other.differences_, &differences_); }

double PictureNoise::Deviation() const { return NoiseOf(differences_); }

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
