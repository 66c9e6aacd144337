// Structure-from-motion on badly lit photos: COLMAP as a supervised child program, fed with
// photos prepared for the light they were taken in. Poses and points come back; the photos
// themselves are never changed.
#ifndef LITAGS_ENGINE_SFM_SFM_H_
#define LITAGS_ENGINE_SFM_SFM_H_

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "engine/core/cancel.h"
#include "engine/io/mask_io.h"
#include "engine/io/rig.h"
#include "engine/io/sparse_model.h"

namespace litags {

// How the capture is lit; decides the order of preparations.
enum class Exposure { kNormal, kLow, kOver };

inline constexpr uint64_t kMaxSfmSeed = 0x7fffffff;  // COLMAP reads an int

struct SfmOptions {
  std::string colmap = "colmap";  // program name or path; version 3.8
  int threads = 0;                // bound on COLMAP's and our threads; 0: all cores
  uint64_t seed = 0;              // COLMAP's --random_seed; kMaxSfmSeed at most
  int max_image_side = 1600;    // larger photos are matched at this longer side, px; 0: as they are
  int max_features = 0;         // SIFT features per photo; 0: 500..4000, fewer for more photos
  int match_all_up_to = 200;    // photos; of more, each is matched with its most similar ones only
  int similar_photos = 20;      // how many of them
  double min_registered = 0.5;  // fraction of photos that must be placed, else an error, (0, 1]
  double enough_registered = 0.95;     // a rung that places this fraction ends the climb, (0, 1]
  double step_timeout_seconds = 3600;  // wall clock of one COLMAP step; 0: no limit
  double report_seconds = 1;           // least time between reports of one step's progress
  std::function<void(std::string_view)> on_line;  // what COLMAP writes; called by any thread
  RigViews rig_views;  // photos of rigs: the lens is a start, and one that is placed places all
  MaskPaths masks;     // of photos by name: no features and no say in the light where they are 0

  // Of what users set and nobody else checks: INVALID_ARGUMENT naming the field.
  absl::Status Validate() const;
};

// Where the work stands; from the calling thread.
struct SfmProgress {
  std::string preparation;  // "gain + Gaussian 0.7 px"
  std::string step;         // "prepare", "features", "match", "verify", "map", "triangulate"
  int rung = 0;             // 0-based
  int rungs = 1;            // length of the ladder
  double fraction = 0;      // of this step, 0..1, as far as COLMAP tells
};
using SfmProgressFn = std::function<void(const SfmProgress&)>;

// Why a photo has no place in the model.
enum class DropCause {
  kNone,         // it has one
  kFewFeatures,  // too few SIFT features to match anything
  kNoMatches,    // no other photo shows the same things
  kOtherGroup,   // placed in a separate, smaller model
  kNotPlaced,    // matches others, but its pose could not be solved
  kNoCamera,     // TriangulatePoints: no camera was given for it
};

// One photo, as seen by the rung that was kept.
struct SfmPhoto {
  std::string name;
  int features = 0;        // SIFT features found
  int matched_photos = 0;  // photos with a verified match
  DropCause drop = DropCause::kNone;
  std::string reason;  // of the drop, for a human; empty if registered

  bool registered() const { return drop == DropCause::kNone; }
};

// One preparation that was tried.
struct SfmRung {
  std::string preparation;
  int registered = 0;       // photos in the largest model
  int64_t points = 0;       // in the largest model
  std::vector<int> groups;  // photos per separate model, of the largest first; of later ones, those
                            // in no earlier model: more than one is a split capture
  bool turned = false;      // the camera turned in place: no parallax
  double prepare_seconds = 0, feature_seconds = 0, match_seconds = 0, verify_seconds = 0,
         map_seconds = 0;
};

struct SfmResult {
  // Views (named as the photos, in name order, at the photos' own size), their lens distortions,
  // zero where it moves no pixel by more than half a pixel, and points; see
  // engine/io/sparse_model.h. Point colours are those of the prepared photos:
  // sRGB, brought to a mean of .45 in low light.
  SparseModel model;
  Exposure exposure = Exposure::kNormal;
  std::string preparation;       // rung that was kept
  std::vector<SfmRung> rungs;    // in the order tried
  std::vector<SfmPhoto> photos;  // every photo, in name order
  std::vector<std::string>
      notes;  // what the user should know: "the photos split into 2 groups ..."
  double seconds = 0;
};

// Finds the cameras of the photos in images_dir (flat).
//
// Climbs a ladder of preparations until one places enough_registered of the photos: low light:
// gain to mean .45 then Gaussian 0.7 px, the same with 1.2 px, gain + CLAHE; over-exposed: CLAHE,
// photos as they are; else: as they are, CLAHE. If none does, keeps the model with most photos,
// then most points, never the one with the smaller reprojection error. Of split models, the
// largest. work_dir exists or is made; the call uses and clears work_dir/sfm, and leaves COLMAP's
// logs there.
//
// The result is a function of the photos and the options, bit by bit, but not of options.threads:
// docs/experiments/cameras.md says what COLMAP is kept from for that.
//
// Errors: INVALID_ARGUMENT for options, unreadable photos or masks; FAILED_PRECONDITION
// TOO_FEW_PHOTOS, SFM_TOO_FEW_REGISTERED (fewer than kMinPhotos or than min_registered placed; the
// message names photos and causes), SFM_NO_MODEL (none placed), SFM_SPLIT (photos of different
// places: a second group at least half as large as the first), SFM_NO_PARALLAX (the camera turned
// in place), COLMAP_NOT_FOUND, COLMAP_UNSUPPORTED (not 3.8);
// INTERNAL COLMAP_FAILED with COLMAP's last lines, or COLMAP_KILLED if it was ended from outside at
// a preparation's three attempts; DEADLINE_EXCEEDED; CANCELLED within a second.
absl::StatusOr<SfmResult> FindCameras(const std::string& images_dir, const std::string& work_dir,
                                      const SfmOptions& options, const CancelToken& cancel,
                                      const SfmProgressFn& progress = nullptr);

constexpr int kEnoughPointsPerView = 10;  // TriangulatePoints stops climbing there

// Points for photos whose cameras are known (`cameras.views`, `cameras.distortions`; its points are
// ignored). Poses and intrinsics come back exactly as given; photos without a view are left out.
// COLMAP finds the features; matches are checked against the cameras and triangulated by us
// (triangulate.h). Climbs the same ladder until there are kEnoughPointsPerView, else keeps the most
// points. As repeatable as FindCameras.
// Errors as FindCameras, and: NOT_FOUND VIEW_WITHOUT_PHOTO, INVALID_ARGUMENT for cameras that
// do not match their photo's size, FAILED_PRECONDITION SFM_NO_POINTS, SFM_NO_PARALLAX (all cameras
// stand in one place).
absl::StatusOr<SfmResult> TriangulatePoints(const std::string& images_dir,
                                            const SparseModel& cameras, const std::string& work_dir,
                                            const SfmOptions& options, const CancelToken& cancel,
                                            const SfmProgressFn& progress = nullptr);

}  // namespace litags

#endif  // LITAGS_ENGINE_SFM_SFM_H_
