#include "engine/priors/tone.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"

namespace litags {
namespace {

using Histogram = std::array<double, 256>;  // fraction of all samples

Histogram CountCodes(const ImageU8& photo) {
  std::array<int64_t, 256> counts = {};
  for (const uint8_t code : photo.data) ++counts[code];
  Histogram histogram;
  for (int code = 0; code < 256; ++code) histogram[code] = double(counts[code]) / photo.data.size();
  return histogram;
}

template <class Curve>
double Mean(const Histogram& histogram, const Curve& curve) {
  double mean = 0;
  for (int code = 0; code < 256; ++code) mean += histogram[code] * curve(code / 255.0);
  return mean;
}

auto CodeGain(double gain) {
  return [gain](double code) { return std::min(1.0, gain * code); };
}

auto LinearGain(double gain) {
  return [gain](double code) { return SrgbFromLinear(std::min(1.0, gain * LinearFromSrgb(code))); };
}

// The gain in (0, max_gain] that brings the mean closest to theta; the mean grows with the gain.
double SolveLinearGain(const Histogram& histogram, double theta, double max_gain) {
  if (Mean(histogram, LinearGain(max_gain)) <= theta) return max_gain;
  double low = -64, high = std::log2(max_gain);  // stops; at -64 anything is black
  for (int i = 0; i < 60; ++i) {
    const double middle = (low + high) / 2;
    (Mean(histogram, LinearGain(std::exp2(middle))) < theta ? low : high) = middle;
  }
  return std::exp2(high);
}

template <class Curve>
void SetCurve(const Histogram& histogram, const Curve& curve, ToneCurve* tone) {
  for (auto& channel : tone->lut) {
    for (int code = 0; code < 256; ++code) channel[code] = static_cast<float>(curve(code / 255.0));
  }
  tone->mean_after = Mean(histogram, curve);
}

}  // namespace

absl::Status ToneOptions::Validate() const {
  if (!(theta > 0 && theta < 1)) {
    return InvalidInput("BAD_OPTION", "tone.theta",
                        absl::StrCat("tone: theta = ", theta, ", must be in (0, 1)"));
  }
  if (!(max_gain >= 1 && max_gain <= 1e6)) {
    return InvalidInput("BAD_OPTION", "tone.max_gain",
                        absl::StrCat("tone: max_gain = ", max_gain, ", must be in [1, 1e6]"));
  }
  return absl::OkStatus();
}

absl::StatusOr<ToneCurve> MakeToneCurve(const ImageU8& photo, const ToneOptions& options) {
  LITAGS_RETURN_IF_ERROR(options.Validate());
  if (photo.empty()) {
    return InvalidInput("EMPTY_IMAGE", "image", "tone: the photo is empty; leave it out");
  }
  const Histogram histogram = CountCodes(photo);
  ToneCurve tone;
  tone.mean_before = Mean(histogram, CodeGain(1));
  if (options.rule == ToneRule::kNone) {
    tone.lut = IdentityLut();
    tone.mean_after = tone.mean_before;
    return tone;
  }
  if (tone.mean_before == 0) {
    return InvalidInput("BLACK_IMAGE", "image",
                        "tone: every pixel of the photo is 0, no gain can brighten it; leave it "
                        "out or expose longer");
  }
  if (options.rule == ToneRule::kPaperGain) {
    tone.gain = options.theta / tone.mean_before;
    SetCurve(histogram, CodeGain(tone.gain), &tone);
  } else {
    tone.gain = SolveLinearGain(histogram, options.theta, options.max_gain);
    SetCurve(histogram, LinearGain(tone.gain), &tone);
    tone.reached = std::abs(tone.mean_after - options.theta) < 1e-6;
  }
  return tone;
}

}  // namespace litags
