// From the colours of a photo or a video to sRGB, which Photo has.
#ifndef LITAGS_ENGINE_IO_COLOR_SPACE_H_
#define LITAGS_ENGINE_IO_COLOR_SPACE_H_

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "engine/core/photo.h"

namespace litags {

inline constexpr size_t kMaxProfileBytes = size_t{8} << 20;  // printers' have up to 3 MiB

class ColorSpace {
 public:
  // Codes are sRGB's already. `channels`: 1 grey, 3 RGB.
  static ColorSpace Srgb(int channels);
  // Codes are light to the power 1 / `exponent` (1: light itself), with sRGB's primaries.
  static ColorSpace Gamma(double exponent, int channels);
  // Of RGB.
  static ColorSpace AdobeRgb();
  // As an ICC profile says; 4 channels are CMYK. nullopt: it is broken, or for other pixels.
  static std::optional<ColorSpace> FromIcc(std::string_view icc, int channels);
  // The same, and sRGB where there is no use in the profile.
  static ColorSpace FromIccOrSrgb(std::string_view icc, int channels);
  // RGB by the code points of ITU-T H.273; of HLG the light of the scene, 1: the brightest that it
  // has. IMAGE_UNSUPPORTED: the curve is not known, or is PQ's.
  static absl::StatusOr<ColorSpace> FromCodePoints(int primaries, int transfer,
                                                   std::string_view field);

  int channels() const { return channels_; }

  // Codes of 0..1 (more and less are kept), channels interleaved, to samples of Photo. CMYK: ink.
  void Convert(const float* codes, size_t pixels, int16_t* samples) const;

  // The same in place, for a photo whose samples are such codes (grey: R = G = B).
  void Convert(Photo* photo) const;

 private:
  using Curve = std::vector<float>;
  using Matrix = std::array<std::array<float, 3>, 3>;  // [to][from], light

  explicit ColorSpace(int channels) : channels_(channels) {}
  // True if it changes no sample by more than rounding does.
  bool IsNearlySrgb() const;
  static std::shared_ptr<const Curve> MakeCurve(const std::function<double(double)>& light,
                                                double most = 1);

  int channels_;
  bool is_srgb_ = false;
  std::array<std::shared_ptr<const Curve>, 3> curves_;  // code to light
  Matrix matrix_ = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
  std::shared_ptr<void> transform_;  // lcms2's, instead of curves and matrix
};

}  // namespace litags

#endif  // LITAGS_ENGINE_IO_COLOR_SPACE_H_
