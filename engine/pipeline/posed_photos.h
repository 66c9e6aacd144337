// The first stage: from files to photos with cameras.
#ifndef LITAGS_ENGINE_PIPELINE_POSED_PHOTOS_H_
#define LITAGS_ENGINE_PIPELINE_POSED_PHOTOS_H_

#include <array>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "engine/core/camera.h"
#include "engine/core/color.h"
#include "engine/core/photo.h"
#include "engine/io/rig.h"
#include "engine/io/sparse_model.h"
#include "engine/pipeline/context.h"

namespace litags {

constexpr int kPhotosOfColors = 8;  // that the capture's colours are measured on, at most

// The photos that have a camera and show something, by name: index i is one photo throughout. With
// Tone::kCapture the colours of deep shadow are inferred, on the codes as the camera wrote them
// (shadow_color.h).
struct PosedPhotos {
  size_t size() const { return views.size(); }

  std::vector<View> views;              // pinhole cameras at the size of training
  std::vector<Distortion> distortions;  // that the photos had when they were taken
  std::vector<Photo> photos;            // as those cameras see them
  std::vector<PlaneU8> masks;           // as they do; empty: all pixels of the photo count
  std::vector<std::string> sources;     // fingerprints of the files and masks that they are made of
  // Exposure time times ISO by the f-number squared, as EXIF says; 0: it does not say all three.
  std::vector<double> stated_exposures;
  double code_step = 0;    // the coarsest of the photos' (CodeStep, image_io.h)
  double noise_floor = 0;  // of the photos as their cameras wrote them (NoiseLevels::Floor)
  double noise_kept = 1;   // see NoiseAtBlack: what undistorting and shrinking left of the noise
  SparseModel model;       // all cameras and points; tracks name its views
  std::vector<int> model_view;        // index into the model's views, per photo
  RigViews rig_views;                 // photos among them that were taken from one place at once
  std::array<double, 3> origin = {};  // of all this, in the coordinates that the cameras came in
};

// Finds cameras with COLMAP (`colmap`: the program's name or path) unless they are given or kept
// from an earlier run; photos of a wide fisheye that COLMAP solved become the views that
// WithViewsOfWidePhotos makes of them; photos are shrunk to max_image_side. Photos of a single
// colour are left out, with a note. Fills the registration part of the report. FAILED_PRECONDITION
// (TOO_FEW_PHOTOS) if fewer than kMinPhotos remain.
absl::StatusOr<PosedPhotos> LoadPosedPhotos(const Context& context, const std::string& colmap);

}  // namespace litags

#endif  // LITAGS_ENGINE_PIPELINE_POSED_PHOTOS_H_
