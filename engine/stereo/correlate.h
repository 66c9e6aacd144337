// How well a view fits another one if its surface were at given depths: zero-mean normalised
// cross-correlation (ZNCC) of windows, which neither gain nor black level of a photo can change.
#ifndef LITAGS_ENGINE_STEREO_CORRELATE_H_
#define LITAGS_ENGINE_STEREO_CORRELATE_H_

#include <array>
#include <vector>

#include "engine/stereo/match_image.h"

namespace litags {

// Window statistics of a reference view, made once and used for every source and depth.
struct CorrelationReference {
  const MatchImage* image = nullptr;
  int radius = 0;                      // windows are (2 radius + 1)^2 pixels
  std::vector<float> mean, deviation;  // [h w]; 1 / sqrt(variance + noise^2)

  CorrelationReference(const MatchImage& image, int radius);
};

// q = ray [x, y, 1]^T + inverse_depth * shift projects a reference pixel into a source:
// (q0 / q2, q1 / q2) px.
struct Transfer {
  std::array<float, 9> ray;    // K_s R K_r^-1, row-major
  std::array<float, 3> shift;  // K_s t

  Transfer(const Camera& reference, const Camera& source);

  // q. Behind the source unless q2 > 0, which is depth there over depth in the reference.
  std::array<double, 3> Project(double x, double y, double inverse_depth) const;
};

// Writes the correlation [h w] in [-1, 1] of the windows around every reference pixel with the
// source, each pixel of a window taken at its own 1 / depth [h w] (so windows follow slanted and
// curved surfaces). Variances are increased by the noise's: where there is nothing but noise the
// result is near 0. 0 too where the source does not see the pixel. `scratch` is reused.
void Correlate(const CorrelationReference& reference, const MatchImage& source,
               const Transfer& transfer, const float* inverse_depth, std::vector<float>* scratch,
               float* zncc);

}  // namespace litags

#endif  // LITAGS_ENGINE_STEREO_CORRELATE_H_
