// Options of the normal-light pseudo-target (tone.h).
#ifndef LITAGS_ENGINE_TARGET_TONE_OPTIONS_H_
#define LITAGS_ENGINE_TARGET_TONE_OPTIONS_H_

#include "absl/status/status.h"

namespace litags {

// How the target is made. Values are stored with jobs.
enum class Tone {
  kPaper = 0,    // clip(theta / mean(I) * I, 0, 1) on 8-bit sRGB codes, photo by photo: the paper
  kNone = 2,     // the photo as it is
  kCapture = 3,  // one gain in linear light for the capture, see CaptureGain(); clipped areas are
                 // filled in (highlights.h), colour noise is averaged (chroma.h), mild contrast
};

struct ToneOptions {
  Tone rule = Tone::kCapture;
  double theta = 0.49;     // of kPaper: wanted mean of sRGB codes, (0, 1). Authors' release
  double max_gain = 4096;  // of linear light; >= 1. Choice: 12 stops
  // Of kCapture, [0, 1]: code c becomes c + contrast * c (1 - c) (2 c - 1). Cameras' picture
  // styles add contrast, so an exact inverse of the sRGB curve looks flat. Choice, measured
  double contrast = 0.15;
  // Of kCapture, [0, 100]: colours of dark photos are averaged over neighbours that are alike
  // up to this many deviations of the noise (chroma.h); 0: never. Choice, measured
  double chroma_smoothing = 2;

  absl::Status Validate() const;
};

}  // namespace litags

#endif  // LITAGS_ENGINE_TARGET_TONE_OPTIONS_H_
