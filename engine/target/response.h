// What a capture's camera did to the light of the scene: a white balance for every photo, a lens
// that is darker at the corners, and a lamp that lights what is near.
#ifndef LITAGS_ENGINE_TARGET_RESPONSE_H_
#define LITAGS_ENGINE_TARGET_RESPONSE_H_

#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "absl/types/span.h"
#include "engine/core/cancel.h"
#include "engine/core/color.h"
#include "engine/core/photo.h"
#include "engine/target/photometric.h"

namespace litags {

// What one photo says of the light of one point of the scene.
struct PointSample {
  int point = 0;
  int photo = 0;
  double radius = 0;                     // see RadiusOf()
  std::array<double, 3> log_light = {};  // red, green, blue; of linear light, 1: white
  double log_distance = 0;               // of the point from the camera, scene units
  // Whether every channel is told; else only their sum is, as where blue is black in warm light.
  bool tells_color = true;
};

// Centre and scale of radii in one photo, px. Pixel centres are at +0.5.
struct RadialFrame {
  double cx = 0, cy = 0;     // the principal point
  double half_diagonal = 1;  // of the whole picture, > 0
};

// The lens' light at radius r (0: the principal point, 1: half the picture's diagonal away) is
// V(r) = exp(a r^2 + b r^4 + c r^6): 1 in the middle, falling. All 0: even light.
using Vignette = std::array<double, 3>;

struct CaptureResponse {
  // Per photo, red, green, blue: the photo shows the capture's light times these. Green's is 1,
  // since the photo's exposure is found elsewhere (photometric.h). The median photo's are 1.
  std::vector<std::array<double, 3>> gains;
  Vignette vignette = {};
  // Light of a lamp that the camera carries falls with the distance r from it, and is as it is at
  // the samples' median distance: (lamp_distance / r)^lamp_power. 0: the light does not move with
  // the camera; 2: there is no other.
  double lamp_power = 0;
  double lamp_distance = 1;  // scene units
};

// log V(r); beyond radius 1 it is what it is there.
double LogVignette(const Vignette& vignette, double radius);

// How many stops darker the lens makes the corners, >= 0.
double CornerStops(const Vignette& vignette);

// Light of 5x5 pixels around every sighting, sorted by point as they are. Sightings that are cut
// off, masked, nearly black (not TellsLight) or clipped are left out, and with them all others of
// that point: what is left of a point would say that its light is the more even, the more was cut.
// For the same reason no sample of a point tells colours if one does not (AboveBlack).
// `frames`: one per photo. `masks`: see MaskOf. `code_step`: see FileSteps (shadow_color.h).
std::vector<PointSample> SamplePoints(absl::Span<const Photo> photos,
                                      absl::Span<const PointSighting> sightings,
                                      absl::Span<const RadialFrame> frames,
                                      absl::Span<const PlaneU8> masks = {}, double code_step = 1);

// White balances, vignette and lamp that make the photos agree on the points that they share.
// Robust: up to a third of the samples may be wrong. What samples do not show for sure is not
// there:
// - A photo with fewer than kMinSightings samples that tell colours has gains of 1, and all have if
//   none differs by kLeastColor or more. Gains are drawn to 1 by three of their standard errors.
// - The vignette is all 0 unless it takes kLeastVignette or more at the radius that 2 % of the
//   samples lie beyond, and four standard errors (from eight groups of points). It never rises
//   with the radius and takes kMostVignette or less.
// - The lamp's power, kMostLamp or less, is 0 unless it makes the farthest tenth of the samples
//   kLeastLamp darker than the nearest, and is four standard errors, too.
// Samples that are not finite do not count; `samples` is sorted by point. All results are finite.
// Once `cancel` is raised, they soon come, and mean nothing.
CaptureResponse EstimateResponse(size_t photos, absl::Span<const PointSample> samples,
                                 const CancelToken& cancel = CancelToken());

inline constexpr double kLeastColor = 0.02;    // log of a gain. 2 % is hardly seen
inline constexpr double kLeastVignette = 0.5;  // stops. Cameras' own correction leaves up to 0.4
inline constexpr double kMostVignette = 5;     // stops
inline constexpr double kLeastLamp = 1;        // stops. Photos without a lamp show up to 0.54
inline constexpr double kMostLamp = 2;         // of its power: light falls with the square

// The response without what neighbouring photos' white balances agree on (WithoutDrift()).
CaptureResponse WithoutColorDrift(const CaptureResponse& response,
                                  absl::Span<const PointSample> samples);

// Divides the photo's linear light by gain (red, green, blue, > 0) and by V. Samples that get
// darker and lie within a tenth of white are changed less, at white not at all: of a clipped sample
// only that it is bright is known, and it stays so. Does nothing if all gains are 1 and the
// vignette is 0. 2 megapixels take 0.1 s of one core.
void ApplyResponse(const std::array<double, 3>& gain, const Vignette& vignette,
                   const RadialFrame& frame, Photo* photo);

// Where ApplyResponse made a photo brighter, which moves its white: whether a sample is clipped is
// told by what the camera stored.
class Brightening {
 public:
  Brightening() = default;  // nowhere
  Brightening(const std::array<double, 3>& gain, const Vignette& vignette,
              const RadialFrame& frame);

  bool none() const { return none_; }

  // By how much red, green and blue light of the pixel grew, >= 1.
  std::array<float, 3> At(int x, int y) const;

  // The photo as it was stored, but for what grew darker.
  Photo Undone(const Photo& photo) const;

 private:
  bool none_ = true;
  std::array<float, 3> factor_ = {1, 1, 1};
  Vignette vignette_ = {};
  RadialFrame frame_;
};

// That of photo i; none if there are none.
inline Brightening BrighteningOf(absl::Span<const Brightening> all, size_t i) {
  return all.empty() ? Brightening() : all[i];
}

// For people: "photos' white balance differs by up to 12 %: evened out", or nothing.
std::vector<std::string> DescribeResponse(const CaptureResponse& response);

}  // namespace litags

#endif  // LITAGS_ENGINE_TARGET_RESPONSE_H_
