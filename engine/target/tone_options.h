// Options of the normal-light pseudo-target (tone.h).
#ifndef LITAGS_ENGINE_TARGET_TONE_OPTIONS_H_
#define LITAGS_ENGINE_TARGET_TONE_OPTIONS_H_

#include <utility>

#include "absl/status/status.h"
#include "engine/core/fields.h"

namespace litags {

// How the target is made. Values are stored with jobs.
enum class Tone {
  kPaper = 0,    // clip(theta / mean(I) * I, 0, 1) on 8-bit sRGB codes, photo by photo: the paper
  kNone = 2,     // the photo as it is
  kCapture = 3,  // one gain in linear light for the capture, see CaptureGain(); clipped areas are
                 // filled in (highlights.h), colour noise is averaged (chroma.h), mild contrast
};

template <>
struct EnumWords<Tone> {
  static constexpr std::pair<Tone, const char*> kWords[] = {
      {Tone::kCapture, "capture"}, {Tone::kPaper, "paper"}, {Tone::kNone, "none"}};
};

struct ToneOptions {
  Tone rule = Tone::kCapture;
  double theta = 0.49;     // of kPaper: wanted mean of sRGB codes. Authors' release
  double max_gain = 4096;  // of linear light. Choice: 12 stops
  // Of kCapture: code c becomes c + contrast * c (1 - c) (2 c - 1). Cameras' picture
  // styles add contrast, so an exact inverse of the sRGB curve looks flat. Choice, measured
  double contrast = 0.15;
  // Of kCapture: colours of dark photos are averaged over neighbours that are alike
  // up to this many deviations of the noise (chroma.h); 0: never. Choice, measured
  double chroma_smoothing = 2;

  // INVALID_ARGUMENT (BAD_OPTION) naming the field that breaks its rule.
  absl::Status Validate() const { return CheckFields(*this, ""); }
};

template <class T, class Visit>
void VisitFields(FieldsOf<ToneOptions>, T& t, Visit&& visit) {
  visit("tone", t.rule, FieldRule());
  visit("theta", t.theta,
        FieldRule{.least = 0, .most = 1, .above_least = true, .below_most = true});
  visit("max_gain", t.max_gain, FieldRule{.least = 1, .most = 1e6});
  visit("contrast", t.contrast, FieldRule{.least = 0, .most = 1});
  visit("chroma_smoothing", t.chroma_smoothing, FieldRule{.least = 0, .most = 100});
}

}  // namespace litags

#endif  // LITAGS_ENGINE_TARGET_TONE_OPTIONS_H_
