// The normal-light pseudo-target of a badly lit photo (LITA-GS L_exp), as a 256-entry table per
// channel: a pure function of the photo's histogram.
#ifndef LITAGS_ENGINE_PRIORS_TONE_H_
#define LITAGS_ENGINE_PRIORS_TONE_H_

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "engine/core/color.h"
#include "engine/core/image.h"

namespace litags {

enum class ToneRule {
  kPaperGain,   // clip(theta / mean(I) * I, 0, 1) on sRGB codes: the paper
  kLinearGain,  // a gain in linear light, clipped at white, that brings the mean code to theta
  kNone,        // the photo as it is
};

struct ToneOptions {
  ToneRule rule = ToneRule::kLinearGain;
  double theta = 0.49;     // wanted mean of sRGB codes, (0, 1); authors' release
  double max_gain = 4096;  // of linear light, kLinearGain only; >= 1. Choice: 12 stops

  absl::Status Validate() const;
};

struct ToneCurve {
  ColorLut lut;            // byte to sRGB-encoded value in [0, 1]; monotone
  double gain = 1;         // on codes (kPaperGain) or in linear light (kLinearGain)
  double mean_before = 0;  // of sRGB codes over pixels and channels
  double mean_after = 0;   // of the same through the table
  bool reached = true;     // kLinearGain: false if max_gain was not enough to reach theta
};

// The table for one photo. INVALID_ARGUMENT for bad options, an empty photo, or one that is all
// black (no gain helps; leave it out).
absl::StatusOr<ToneCurve> MakeToneCurve(const ImageU8& photo, const ToneOptions& options);

}  // namespace litags

#endif  // LITAGS_ENGINE_PRIORS_TONE_H_
