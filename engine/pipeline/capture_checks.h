// What is odd about a capture's photos, cameras and points, found before training.
#ifndef LITAGS_ENGINE_PIPELINE_CAPTURE_CHECKS_H_
#define LITAGS_ENGINE_PIPELINE_CAPTURE_CHECKS_H_

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "engine/core/camera.h"
#include "engine/core/color.h"
#include "engine/core/photo.h"
#include "engine/io/image_io.h"
#include "engine/io/sparse_model.h"

namespace litags {

// The colour, in 8-bit codes, of a photo that shows nothing to learn from: black, white or one
// colour throughout, but for a thousandth of its pixels (JPEG and dust in a black photo). Only
// pixels that count by its mask are looked at, of which there is one or more.
std::optional<std::array<uint8_t, 3>> FlatColor(const Photo& photo, const PlaneU8& mask = {});

// What a photo's file cannot tell.
struct PhotoDarkness {
  double black = 0;     // share of the pixels whose luma is below code 1, in files of 8 bits
  bool narrow = false;  // a PNG or TIFF of 16 bits whose values are all below 256
  bool close = false;   // one whose values all lie close together, far from 0, as temperatures do
};
PhotoDarkness MeasureDarkness(const Photo& photo, const PlaneU8& mask, const ImageInfo& info);

// Says so if most of what the photos show is black, if files of 16 bits hold numbers of 8, or
// numbers that are no light. Not empty; in the order of `views`.
void NoteDarkness(const std::vector<View>& views, const std::vector<PhotoDarkness>& photos,
                  std::vector<std::string>* notes);

// Says so if the photos of a capture were exposed very differently, and whether they were
// `evened_out`.
void NoteExposures(const std::vector<View>& views, const std::vector<double>& exposures,
                   bool evened_out, std::vector<std::string>* notes);

// What is nearer to a camera than this is not drawn, scene units: 3DGS's 0.2, or less where photos
// saw points as near as that.
float NearPlaneOf(const SparseModel& model);

// Scene units are the user's, but floats end somewhere. Drops points that are too far, with a note.
// INVALID_ARGUMENT (SCENE_TOO_LARGE, SCENE_TOO_SMALL; field "cameras") for scenes that cannot be
// drawn.
absl::Status CheckScale(const std::vector<View>& views, float near_plane,
                        std::vector<SparsePoint>* points, std::vector<std::string>* notes);

}  // namespace litags

#endif  // LITAGS_ENGINE_PIPELINE_CAPTURE_CHECKS_H_
