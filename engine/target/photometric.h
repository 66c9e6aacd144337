// How much light each photo of a capture gathered, from points that several photos saw.
#ifndef LITAGS_ENGINE_TARGET_PHOTOMETRIC_H_
#define LITAGS_ENGINE_TARGET_PHOTOMETRIC_H_

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "absl/types/span.h"
#include "engine/core/cancel.h"
#include "engine/core/color.h"
#include "engine/core/photo.h"

namespace litags {

// A point of the scene as one photo saw it.
struct PointSighting {
  int point = 0;
  int photo = 0;
  double x = 0, y = 0;  // px, centres at +0.5
  double distance = 1;  // from the camera, scene units, > 0
  double lit = 1;       // its light there is so much of what it is, > 0; by a lamp at the camera
};

// Means over the 5x5 pixels around a place: single pixels of dark photos are mostly noise.
struct PatchLight {
  std::array<double, 3> codes = {};  // 8-bit codes, with fractions
  std::array<double, 3> noise = {};  // of the pixels' codes, standard deviation
  std::array<double, 3> light = {};  // linear, 1: white
  int16_t brightest = 0;             // sample of any channel
};

// Nothing if the patch is cut off or a pixel of it is masked. (x, y) in px, centres at +0.5.
std::optional<PatchLight> PatchLightAt(const Photo& photo, const PlaneU8& mask, double x, double y);

// Whether a patch is so far above black that its mean tells its light: rounding and black's cut
// change that of darker ones. By two of the file's steps in every channel, and by two deviations of
// its pixels; two 8-bit codes always will do. `code_step`: see FileSteps (shadow_color.h).
bool AboveBlack(const PatchLight& patch, double code_step);

// Whether a patch tells the sum of its channels' light: one may be near black where the others
// outshine it, as blue is in sodium light. So it is of all that are AboveBlack.
bool TellsLight(const PatchLight& patch, double code_step);

// Exposure of every photo relative to the capture's median photo, > 0: photo i shows the scene's
// linear light times exposure i. Medians in the log domain, so that highlights, shadows and wrong
// matches do not matter; samples near black (not TellsLight) or white are left out. A photo that
// shares fewer than kMinSightings usable points with the others has the exposure that it states
// beside theirs; if it states none, or what they state is not so (a changed, edited or merged
// photo's EXIF), it is taken to have the same median light as they have. Where fewer than
// kMinStated photos share enough points, the others have what they state. `stated`: one per photo,
// in any unit, 0: none; or empty. Sightings are sorted by point. `masks`: see MaskOf; a sighting
// with a masked pixel in its patch does not count. `code_step`: as for AboveBlack. The same for any
// `threads`; once `cancel` is raised, all soon are 1.
std::vector<double> RelativeExposures(absl::Span<const Photo> photos,
                                      absl::Span<const PointSighting> sightings,
                                      absl::Span<const PlaneU8> masks = {},
                                      absl::Span<const double> stated = {}, double code_step = 1,
                                      int threads = 1, const CancelToken& cancel = CancelToken());

inline constexpr int kMinSightings = 20;

// What photos state is believed if this many are known otherwise, and deviate from it by this at
// most, as their median tells it: shutters and apertures are named in thirds of a stop.
inline constexpr size_t kMinStated = 4;
inline constexpr double kMostStatedError = 0.25;  // of the log

// Exposures without what changes smoothly with the viewpoint, the drift: of each, the mean of the
// photos that see the same points, weighed by the cube of how many they share, is taken away (in
// the log domain); the median's is 1 again. What such photos agree on is the light as it comes from
// there, or the camera's own slow adaptation, and colours that depend on the direction of view can
// say it; chained over photos that share little it is also the estimate's own error. What a photo
// differs by from those beside it is its shutter's. Choice, measured.
//
// The drift d that neighbours show counts with s^2 / (s^2 + v): v is the variance of their mean,
// which is large where photos differ much, s = 0.15 what drift deviates by. A drift beyond half a
// stop was chosen in part: only what it lacks of a stop counts. Photos a stop (and three
// deviations) or more off their neighbours have no say in the others' means. `sightings` as above.
std::vector<double> WithoutDrift(const std::vector<double>& exposures,
                                 absl::Span<const PointSighting> sightings);

}  // namespace litags

#endif  // LITAGS_ENGINE_TARGET_PHOTOMETRIC_H_
