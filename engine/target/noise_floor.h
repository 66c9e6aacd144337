// How bright noise alone makes what no light fell on.
#ifndef LITAGS_ENGINE_TARGET_NOISE_FLOOR_H_
#define LITAGS_ENGINE_TARGET_NOISE_FLOOR_H_

#include <cstdint>
#include <vector>

#include "absl/types/span.h"
#include "engine/core/photo.h"

namespace litags {

// How pixels of dark squares (LightSquare) of about the same light differ; of one photo, or of
// several added up. Photos should be as their cameras wrote them: what shrinks, undistorts or
// smooths them takes differences away and leaves the light.
class NoiseLevels {
 public:
  NoiseLevels();
  // `mask`: see engine/core/mask.h.
  NoiseLevels(const Photo& photo, const PlaneU8& mask);

  void Add(const NoiseLevels& other);

  // The mean light of a square, linear in the photos' own codes, up to which noise explains it; 0:
  // none. Black cuts noise's darker half off, which leaves 0.40 of its deviation in the mean and
  // 0.58 in the deviation (black_lift.h). So squares are noise where their pixels differ more than
  // they are bright. Light of a fifth of the noise counts as noise, too, and so do squares of 8-bit
  // photos of which two fifths of the pixels have code 1 and the others 0. In JPEGs compression
  // takes much of the differences away: there the floor is too low.
  double Floor() const;

  // Mean variance of a channel within the squares, linear; 0: there are none.
  double Variance() const;

 private:
  // Squares of about the same light, sums over their channels.
  struct Level {
    int64_t channels = 0;
    double mean = 0, variance = 0;

    bool IsNoise() const;
  };
  std::vector<Level> levels_;
};

// The floor of all photos. `masks`: see MaskOf. Deterministic for any `threads` (<= 0: all cores).
double NoiseFloor(absl::Span<const Photo> photos, int threads,
                  absl::Span<const PlaneU8> masks = {});

}  // namespace litags

#endif  // LITAGS_ENGINE_TARGET_NOISE_FLOOR_H_
