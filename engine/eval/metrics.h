// Image quality: PSNR and SSIM, plain and after one colour fit per scene. Double precision.
#ifndef LITAGS_ENGINE_EVAL_METRICS_H_
#define LITAGS_ENGINE_EVAL_METRICS_H_

#include <array>
#include <vector>

#include "absl/status/statusor.h"
#include "engine/core/color.h"
#include "engine/core/image.h"

namespace litags {

// Images are sRGB-encoded with peak 1 (bytes / 255); Planes are used as they are, not clamped.
// Everything here returns INVALID_ARGUMENT for empty images or sizes that differ. What does not
// count by a `mask` (engine/core/mask.h) is taken as equal, and is in no mean; where nothing counts
// a mean is INVALID_ARGUMENT, too.

// -10 log10(mean squared error over all samples), dB; infinity for equal images.
absl::StatusOr<double> Psnr(const ImageU8& a, const ImageU8& b, const PlaneU8& mask = {});
absl::StatusOr<double> Psnr(const Planes& a, const Planes& b, const PlaneU8& mask = {});

enum class SsimBorder {
  kValid,  // only pixels whose window lies inside, as scikit-image
  kZero,   // zero padding, all pixels, as 3DGS' loss and its metrics.py; about 0.01 apart
};

// Mean SSIM over pixels and channels: 11x11 Gaussian window, sigma 1.5, C1 = 0.01^2, C2 = 0.03^2,
// biased moments. kValid needs at least 11x11 px. The same for any `threads` (<= 0: all cores).
// IMAGE_TOO_SMALL also if no pixel that counts has a whole window.
absl::StatusOr<double> Ssim(const ImageU8& a, const ImageU8& b,
                            SsimBorder border = SsimBorder::kValid, const PlaneU8& mask = {});
absl::StatusOr<double> Ssim(const Planes& a, const Planes& b,
                            SsimBorder border = SsimBorder::kValid, int threads = 1,
                            const PlaneU8& mask = {});

// One affine map of RGB for a whole scene: out_i = sum_j m[4 i + j] rgb_j + m[4 i + 3].
struct ColorFit {
  std::array<double, 12> m = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};

  // Applied to the first three planes, clamped to [0, 1].
  Planes Apply(const Planes& image) const;
};

// Accumulates (render, truth) pairs and finds the map of renders to truths with the least squared
// error. A diagnostic, never a result: the gap between corrected and plain PSNR is tone error.
class ColorFitter {
 public:
  absl::Status Add(const Planes& render, const Planes& truth, const PlaneU8& mask = {});
  absl::Status Add(const ImageU8& render, const ImageU8& truth, const PlaneU8& mask = {});

  // The best map. Directions in which the renders' colours do not vary (a grey scene) are
  // resolved by the smallest change from the identity. FAILED_PRECONDITION before any Add.
  absl::StatusOr<ColorFit> Fit() const;

 private:
  std::array<double, 16> xtx_ = {};  // sum of [r g b 1]^T [r g b 1]
  std::array<double, 12> xty_ = {};  // sum of truth_i [r g b 1], row i
  double count_ = 0;
};

struct CorrectedPsnr {
  double corrected_db = 0;  // mean over the pairs of Psnr, after the scene's one ColorFit
  ColorFit fit;
};

// PSNR of a scene's pairs after their common colour fit. The vectors have one length,
// not zero; `masks` may be empty.
absl::StatusOr<CorrectedPsnr> AffineCorrectedPsnr(const std::vector<ImageU8>& renders,
                                                  const std::vector<ImageU8>& truths,
                                                  const std::vector<PlaneU8>& masks = {});

}  // namespace litags

#endif  // LITAGS_ENGINE_EVAL_METRICS_H_
