#include "engine/target/photometric.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <optional>

#include "engine/core/color.h"
#include "engine/core/mask.h"
#include "engine/core/parallel.h"
#include "engine/core/pixel_at.h"
#include "engine/core/quantile.h"
#include "engine/target/sample_counts.h"

namespace litags {
namespace {

constexpr int kRadius = 2;            // px: a patch of 5x5 averages the noise
constexpr double kMaxCode = 250;      // 8-bit, of a patch's mean in every channel
constexpr int16_t kLeastSample = 16;  // a quarter of a code: what a photo's median is at least
constexpr int kRounds = 50;           // of alternating medians
constexpr double kUntoldLight =
    0.05;  // of a patch's light that may lie in channels near black. Choice

// Of WithoutDrift(), logs. Choices
constexpr double kDrift = 0.15;                     // deviation of drift, beforehand
constexpr double kMostDrift = std::numbers::ln2;    // a stop
constexpr double kChosenApart = std::numbers::ln2;  // a stop from the neighbours, at least

struct Sample {
  int point, photo;
  double log_light;
};

// The mean of the two in the middle if there are two: alternating medians that take one of them
// stop far from where they would go to, since a point that two photos see is then just as one of
// them says.
double MiddleOf(std::vector<double>& values) {
  const double upper = MedianInPlace(values);
  if (values.size() % 2 == 1) return upper;
  return (upper + *std::max_element(values.begin(), values.begin() + values.size() / 2)) / 2;
}

// The least of a channel's mean code that tells its light.
double LeastCode(const PatchLight& patch, int channel, double code_step) {
  constexpr double kSteps = 2, kDeviations = 2, kSure = 2;  // codes
  const double least = std::min(kSteps * std::max(code_step, 1.0 / kPhotoCode), kSure);
  return std::clamp(kDeviations * patch.noise[channel], least, kSure);
}

// Log of the mean linear light of a patch; nothing if it is cut off, masked, black or white.
std::optional<double> LogLight(const Photo& photo, const PlaneU8& mask, double x, double y,
                               double code_step) {
  const std::optional<PatchLight> patch = PatchLightAt(photo, mask, x, y);
  if (!patch.has_value() || !TellsLight(*patch, code_step)) return std::nullopt;
  for (const double code : patch->codes) {
    if (code > kMaxCode) return std::nullopt;
  }
  return std::log((patch->light[0] + patch->light[1] + patch->light[2]) / 3);
}

// Log of the median linear light of a whole photo.
double LogMedianLight(const Photo& photo, const PlaneU8& mask) {
  SampleCounts counts;
  ForCounted(mask, photo.pixels(), [&](size_t i) {
    for (size_t k = 3 * i; k < 3 * i + 3; ++k) counts.Add(photo.data[k]);
  });
  return std::log(LinearTable::Get()(std::max(counts.Median(), kLeastSample)));
}

std::vector<Sample> TakeSamples(absl::Span<const Photo> photos,
                                absl::Span<const PointSighting> sightings,
                                absl::Span<const PlaneU8> masks, double code_step) {
  std::vector<Sample> samples;
  for (const PointSighting& s : sightings) {
    const auto light = LogLight(photos[s.photo], MaskOf(masks, s.photo), s.x, s.y, code_step);
    if (light.has_value()) samples.push_back({s.point, s.photo, *light - std::log(s.lit)});
  }
  return samples;
}

// Calls use(begin, end) for the sightings or samples of every point.
template <class Sorted, class Use>
void ForEachPoint(const Sorted& sorted, const Use& use) {
  for (auto begin = sorted.begin(), end = begin; begin != sorted.end(); begin = end) {
    while (end != sorted.end() && end->point == begin->point) ++end;
    use(begin, end);
  }
}

// How alike the views of two photos are, [n, n], 0 to 1: the share of their points that both see,
// cubed; 0 of a photo and itself.
std::vector<double> Likeness(size_t n, absl::Span<const PointSighting> sightings) {
  std::vector<double> shared(n * n, 0.0);
  ForEachPoint(sightings, [&](auto begin, auto end) {
    for (auto a = begin; a != end; ++a) {
      for (auto b = begin; b != end; ++b) shared[a->photo * n + b->photo] += 1;
    }
  });
  std::vector<double> likeness(n * n, 0.0);
  for (size_t i = 0; i < n; ++i) {
    for (size_t j = 0; j < n; ++j) {
      const double all = std::sqrt(shared[i * n + i] * shared[j * n + j]);
      if (j != i && all > 0) likeness[i * n + j] = std::pow(shared[i * n + j] / all, 3);
    }
  }
  return likeness;
}

struct WeightedMean {
  double mean = 0;
  double variance = 0;  // in variances of a value
};

// Of the values, once for every row of weights [n, n].
std::vector<WeightedMean> MeansAround(const std::vector<double>& weights,
                                      const std::vector<double>& values) {
  const size_t n = values.size();
  std::vector<WeightedMean> out(n);
  for (size_t i = 0; i < n; ++i) {
    double sum = 0, total = 0, squares = 0;
    for (size_t j = 0; j < n; ++j) {
      const double weight = weights[i * n + j];
      sum += weight * values[j];
      total += weight;
      squares += weight * weight;
    }
    if (total > 0) out[i] = {sum / total, squares / (total * total)};
  }
  return out;
}

// Standard deviation of the values from what is around them.
double Deviation(const std::vector<double>& values, const std::vector<WeightedMean>& around) {
  std::vector<double> sizes;
  for (size_t i = 0; i < values.size(); ++i) sizes.push_back(std::abs(values[i] - around[i].mean));
  return DeviationFromMagnitudes(sizes);
}

// Gives every photo a say in its own mean, that of the most alike other. Those that were chosen
// apart from their neighbours get none, and lose what they have in the others' means.
void AddThemselves(const std::vector<double>& logs, std::vector<double>* likeness) {
  const size_t n = logs.size();
  const std::vector<WeightedMean> others = MeansAround(*likeness, logs);
  const double most = std::max(kChosenApart, 3 * Deviation(logs, others));
  std::vector<double> most_alike;
  for (size_t i = 0; i < n; ++i) {
    const auto row = likeness->begin() + i * n;
    most_alike.push_back(*std::max_element(row, row + n));
  }
  for (size_t i = 0; i < n; ++i) {
    const bool apart = std::abs(logs[i] - others[i].mean) > most;
    (*likeness)[i * n + i] = apart ? 0 : most_alike[i];
    for (size_t j = 0; j < n && apart; ++j) (*likeness)[j * n + i] = 0;
  }
}

// Gives photos that are not `known` what they state beside those that are, if that is believed; or
// beside each other if none is. Of fewer than kMinStated photos that are known nothing tells
// whether the others state the truth: they are better than none.
void TakeStated(absl::Span<const double> stated, const std::vector<bool>& known,
                std::vector<double>* log_exposure) {
  if (stated.empty()) return;
  const bool few = std::count(known.begin(), known.end(), true) < static_cast<int>(kMinStated);
  std::vector<double> offsets, of_known;
  for (size_t i = 0; i < known.size(); ++i) {
    if (!(stated[i] > 0)) continue;
    offsets.push_back((*log_exposure)[i] - std::log(stated[i]));
    if (known[i]) of_known.push_back(offsets.back());
  }
  const bool by_known = !of_known.empty();
  if (by_known) offsets = std::move(of_known);
  if (offsets.empty() || (!few && (!by_known || offsets.size() < kMinStated))) return;
  std::vector<double> errors = offsets;
  const double middle = MedianInPlace(errors);
  for (double& error : errors) error = std::abs(error - middle);
  if (by_known && DeviationFromMagnitudes(errors) > kMostStatedError) return;
  for (size_t i = 0; i < known.size(); ++i) {
    if (!known[i] && stated[i] > 0) (*log_exposure)[i] = std::log(stated[i]) + middle;
  }
}

// Exponentials, the median's is 1.
std::vector<double> FromLogs(const std::vector<double>& logs) {
  std::vector<double> sorted = logs;
  const double shift = logs.empty() ? 0 : MedianInPlace(sorted);
  std::vector<double> out;
  for (const double log : logs) out.push_back(std::exp(log - shift));
  return out;
}

}  // namespace

std::optional<PatchLight> PatchLightAt(const Photo& photo, const PlaneU8& mask, double x,
                                       double y) {
  const std::optional<PixelIndex> middle = PixelAt(x, y, photo.width, photo.height);
  if (!middle.has_value()) return std::nullopt;
  const auto [px, py] = *middle;
  if (px < kRadius || py < kRadius || px + kRadius >= photo.width || py + kRadius >= photo.height)
    return std::nullopt;
  constexpr double kPart = 1.0 / ((2 * kRadius + 1) * (2 * kRadius + 1));
  const LinearTable& linear = LinearTable::Get();
  PatchLight patch;
  std::array<double, 3> squares = {};
  patch.brightest = *photo.pixel(px, py);
  for (int v = py - kRadius; v <= py + kRadius; ++v) {
    for (int u = px - kRadius; u <= px + kRadius; ++u) {
      if (!Counts(mask, u, v)) return std::nullopt;
      const int16_t* pixel = photo.pixel(u, v);
      for (int c = 0; c < 3; ++c) {
        const double code = pixel[c] / kPhotoCode;
        patch.codes[c] += kPart * code;
        squares[c] += kPart * code * code;
        patch.light[c] += kPart * linear(pixel[c]);
        patch.brightest = std::max(patch.brightest, pixel[c]);
      }
    }
  }
  for (int c = 0; c < 3; ++c) {
    patch.noise[c] = std::sqrt(std::max(0.0, squares[c] - patch.codes[c] * patch.codes[c]));
  }
  return patch;
}

bool AboveBlack(const PatchLight& patch, double code_step) {
  for (int c = 0; c < 3; ++c) {
    if (patch.codes[c] < LeastCode(patch, c, code_step)) return false;
  }
  return true;
}

bool TellsLight(const PatchLight& patch, double code_step) {
  const double most = kUntoldLight * (patch.light[0] + patch.light[1] + patch.light[2]);
  for (int c = 0; c < 3; ++c) {
    const double least = LeastCode(patch, c, code_step);
    if (patch.codes[c] < least && LinearFromSrgb(least / 255) > most) return false;
  }
  return true;
}

std::vector<double> RelativeExposures(absl::Span<const Photo> photos,
                                      absl::Span<const PointSighting> sightings,
                                      absl::Span<const PlaneU8> masks,
                                      absl::Span<const double> stated, double code_step,
                                      int threads, const CancelToken& cancel) {
  const std::vector<Sample> samples = TakeSamples(photos, sightings, masks, code_step);
  const size_t n = photos.size();
  std::vector<double> medians(n), log_exposure(n, 0.0);
  ParallelFor(threads, n, [&](size_t i, int) {
    if (!cancel.IsCancelled()) medians[i] = LogMedianLight(photos[i], MaskOf(masks, i));
  });
  if (cancel.IsCancelled()) return std::vector<double>(n, 1.0);
  // A start that is right but for what the photos show; the medians of shared points refine it.
  std::vector<double> sorted = medians;
  const double middle = n > 0 ? MedianInPlace(sorted) : 0;
  for (size_t i = 0; i < n; ++i) log_exposure[i] = medians[i] - middle;

  std::vector<double> values;
  std::vector<std::vector<double>> residuals(n);
  for (int round = 0; round < kRounds; ++round) {
    for (auto& r : residuals) r.clear();
    ForEachPoint(samples, [&](auto begin, auto end) {
      if (end - begin < 2) return;
      values.clear();
      for (auto s = begin; s != end; ++s) values.push_back(s->log_light - log_exposure[s->photo]);
      const double albedo = MiddleOf(values);
      for (auto s = begin; s != end; ++s) residuals[s->photo].push_back(s->log_light - albedo);
    });
    for (size_t i = 0; i < n; ++i) {
      if (residuals[i].size() >= kMinSightings) log_exposure[i] = MiddleOf(residuals[i]);
    }
  }
  std::vector<bool> known;
  for (const auto& r : residuals) known.push_back(r.size() >= kMinSightings);
  TakeStated(stated, known, &log_exposure);
  return FromLogs(log_exposure);
}

std::vector<double> WithoutDrift(const std::vector<double>& exposures,
                                 absl::Span<const PointSighting> sightings) {
  std::vector<double> logs;
  for (const double exposure : exposures) logs.push_back(std::log(exposure));
  std::vector<double> likeness = Likeness(logs.size(), sightings);
  AddThemselves(logs, &likeness);
  const std::vector<WeightedMean> around = MeansAround(likeness, logs);
  const double own = Deviation(logs, around);
  for (size_t i = 0; i < logs.size(); ++i) {
    const double drift = around[i].mean, variance = own * own * around[i].variance;
    const double likely = drift * kDrift * kDrift / (kDrift * kDrift + variance);
    const double stays = std::min(std::abs(likely), kMostDrift - std::abs(drift));
    if (stays > 0) logs[i] -= std::copysign(stays, drift);
  }
  return FromLogs(logs);
}

}  // namespace litags
