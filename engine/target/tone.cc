#include "engine/target/tone.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "engine/core/check.h"
#include "engine/core/color.h"
#include "engine/core/error.h"
#include "engine/core/mask.h"
#include "engine/core/parallel.h"
#include "engine/target/bisect.h"
#include "engine/target/chroma.h"
#include "engine/target/clipped_colors.h"
#include "engine/target/exposure_rule.h"
#include "engine/target/highlights.h"

namespace litags {
namespace {

using Histogram = std::array<double, 256>;  // fraction of all samples that count, by 8-bit code

Histogram SharesOfCodes(const ImageU8& photo, const PlaneU8& mask) {
  Histogram histogram = {};
  const double share = 1.0 / (3 * CountedPixels(mask, photo.pixels()));
  ForCounted(mask, photo.pixels(), [&](size_t i) {
    for (int c = 0; c < 3; ++c) histogram[photo.data[3 * i + c]] += share;
  });
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

double AddContrast(double code, double contrast) {
  return code + contrast * code * (1 - code) * (2 * code - 1);
}

// Linear light to codes.
auto CaptureCurve(double gain, double contrast) {
  return [gain, contrast](double linear) {
    return AddContrast(SrgbFromLinear(std::clamp(gain * linear, 0.0, 1.0)), contrast);
  };
}

// What becomes of a photo's code, where nothing else than the tone acts on it.
double TargetCode(const ToneOptions& options, double gain, double code) {
  switch (options.rule) {
    case Tone::kPaper:
      return CodeGain(gain)(code);
    case Tone::kCapture:
      return CaptureCurve(gain, options.contrast)(LinearFromSrgb(code));
    case Tone::kNone:
      break;
  }
  return code;
}

// The photo's 8-bit codes after the curve, as 8-bit codes.
template <class Curve>
Photo ApplyToCodes(const ImageU8& photo, const Curve& curve) {
  std::array<uint8_t, 256> lut;
  for (int code = 0; code < 256; ++code) {
    lut[code] = static_cast<uint8_t>(std::lround(255 * std::clamp(curve(code / 255.0), 0.0, 1.0)));
  }
  ImageU8 out(photo.width, photo.height);
  for (size_t i = 0; i < out.data.size(); ++i) out.data[i] = lut[photo.data[i]];
  return PhotoFromU8(out);
}

// LITA-GS Eq. 11: theta / mean(I_in) * I_in.
ToneTarget PaperTarget(const Photo& photo, const PlaneU8& mask, double theta) {
  const ImageU8 codes = PhotoToU8(photo);
  const double mean = Mean(SharesOfCodes(codes, mask), CodeGain(1));
  ToneTarget target;
  target.gain = theta / mean;
  target.image = ApplyToCodes(codes, CodeGain(target.gain));
  return target;
}

// `colors`: of a photo with highlights to fill in, else null.
ToneTarget CaptureTarget(const Photo& photo, const PlaneU8& mask, double gain,
                         const ClippedColors* colors, const Brightening& brightened,
                         const ToneOptions& options) {
  ToneTarget target;
  target.gain = std::min(gain, options.max_gain);
  target.reached = gain <= options.max_gain;
  gain = target.gain;
  const auto curve = CaptureCurve(gain, options.contrast);
  target.image = colors != nullptr
                     ? FillHighlights(photo, gain, *colors, curve, brightened)
                     : SmoothChroma(photo, gain, options.chroma_smoothing, curve, mask);
  return target;
}

// Whether the camera clipped a sample.
bool HasClipped(const Photo& photo, const Brightening& brightened) {
  const Photo stored = brightened.none() ? Photo() : brightened.Undone(photo);
  const std::vector<int16_t>& data = brightened.none() ? photo.data : stored.data;
  return std::any_of(data.begin(), data.end(),
                     [](int16_t sample) { return sample >= kClippedSample; });
}

std::vector<ToneTarget> CaptureTargets(absl::Span<const Photo> photos,
                                       absl::Span<const double> exposures,
                                       const ToneOptions& options, int threads,
                                       const CaptureFacts& facts,
                                       const std::function<void(int)>& done,
                                       const CancelToken& cancel) {
  const double gain = CaptureGain(photos, exposures, threads, facts);
  std::vector<char> clipped(photos.size(), false);
  ParallelFor(threads, photos.size(), [&](size_t i, int) {
    if (cancel.IsCancelled()) return;
    clipped[i] = gain < exposures[i] && HasClipped(photos[i], BrighteningOf(facts.brightened, i));
  });
  // By quarters of a stop: finer, exposures make no difference to what is clipped.
  std::map<int, ClippedColors> tables;
  std::vector<const ClippedColors*> colors(photos.size(), nullptr);
  ScenePalette palette;
  for (size_t i = 0; i < photos.size(); ++i) {
    if (!clipped[i] || cancel.IsCancelled()) continue;
    if (tables.empty()) {
      palette =
          CollectPalette(photos, exposures, gain, facts.masks, facts.brightened, threads, cancel);
    }
    const int step = static_cast<int>(std::lround(4 * std::log2(exposures[i])));
    colors[i] = &tables.try_emplace(step, palette, std::exp2(step / 4.0)).first->second;
  }
  std::vector<ToneTarget> targets(photos.size());
  ParallelFor(threads, photos.size(), [&](size_t i, int thread) {
    if (cancel.IsCancelled()) return;
    targets[i] = CaptureTarget(photos[i], MaskOf(facts.masks, i), gain / exposures[i], colors[i],
                               BrighteningOf(facts.brightened, i), options);
    if (done) done(thread);
  });
  return targets;
}

absl::Status CheckPhoto(const Photo& photo, const PlaneU8& mask, Tone rule) {
  if (photo.empty()) {
    return InvalidInput("EMPTY_IMAGE", "image", "tone: the photo is empty; leave it out");
  }
  if (!IsBlack(photo, mask, rule)) return absl::OkStatus();
  return InvalidInput("BLACK_IMAGE", "image",
                      "tone: every pixel of the photo is 0, no gain can brighten it; leave it out "
                      "or expose longer");
}

}  // namespace

bool IsBlack(const Photo& photo, const PlaneU8& mask, Tone rule) {
  if (rule == Tone::kNone) return false;
  // The paper's targets are of 8-bit codes.
  const auto most =
      rule == Tone::kPaper ? static_cast<int16_t>(kPhotoCode / 2) : int16_t{kBlackSample};
  bool black = true;
  ForCounted(mask, photo.pixels(), [&](size_t i) {
    for (size_t k = 3 * i; k < 3 * i + 3; ++k) black = black && photo.data[k] <= most;
  });
  return black;
}

double CaptureGain(absl::Span<const Photo> photos, absl::Span<const double> exposures, int threads,
                   const CaptureFacts& facts) {
  return ExposureGain(CaptureLight(photos, exposures, threads, facts));
}

Photo WithLinearGain(const Photo& photo, double gain) {
  const float factor = static_cast<float>(gain);
  Photo out(photo.width, photo.height);
  std::transform(photo.data.begin(), photo.data.end(), out.data.begin(), [&](int16_t sample) {
    return SampleTable::Get()(std::min(1.0f, factor * LinearTable::Get()(sample)));
  });
  return out;
}

NoiseCurve RoundingNoise(const ToneOptions& options, double gain, double code_step) {
  const auto target = [&](double code) { return TargetCode(options, gain, code); };
  NoiseCurve noise;
  for (int i = 0; i < 256; ++i) {
    const double code = Bisect(target, i / 255.0, 0, 1);
    const double low = std::max(0.0, code - 0.5 / 255), high = std::min(1.0, code + 0.5 / 255);
    const double step = (target(high) - target(low)) / (255 * (high - low));
    noise[i] = static_cast<float>(code_step * step / std::sqrt(12.0));
  }
  return noise;
}

CodeCurve ChangeOfTargets(const ToneOptions& options,
                          const std::function<double(double light)>& change) {
  const auto contrast = [&](double c) { return AddContrast(c, options.contrast); };
  CodeCurve curve;
  for (int i = 0; i < 256; ++i) {
    const double light = LinearFromSrgb(Bisect(contrast, i / 255.0, 0, 1));
    curve[i] = static_cast<float>(contrast(SrgbFromLinear(std::clamp(change(light), 0.0, 1.0))));
  }
  return curve;
}

absl::StatusOr<std::vector<ToneTarget>> MakeTargets(absl::Span<const Photo> photos,
                                                    absl::Span<const double> exposures,
                                                    const ToneOptions& options, int threads,
                                                    const CaptureFacts& facts,
                                                    const std::function<void(int)>& done,
                                                    const CancelToken& cancel) {
  LITAGS_RETURN_IF_ERROR(options.Validate());
  LITAGS_CHECK(photos.size() == exposures.size());
  LITAGS_CHECK(facts.masks.empty() || facts.masks.size() == photos.size());
  for (size_t i = 0; i < photos.size(); ++i) {
    LITAGS_RETURN_IF_ERROR(CheckPhoto(photos[i], MaskOf(facts.masks, i), options.rule));
  }
  if (options.rule == Tone::kCapture) {
    auto targets = CaptureTargets(photos, exposures, options, threads, facts, done, cancel);
    LITAGS_RETURN_IF_ERROR(cancel.Check());
    return targets;
  }
  std::vector<ToneTarget> targets(photos.size());
  ParallelFor(threads, photos.size(), [&](size_t i, int thread) {
    if (cancel.IsCancelled()) return;
    switch (options.rule) {
      case Tone::kPaper:
        targets[i] = PaperTarget(photos[i], MaskOf(facts.masks, i), options.theta);
        break;
      case Tone::kNone:
        targets[i].image = photos[i];
        break;
      case Tone::kCapture:
        break;  // CaptureTargets, above
    }
    if (done) done(thread);
  });
  LITAGS_RETURN_IF_ERROR(cancel.Check());
  return targets;
}

}  // namespace litags
