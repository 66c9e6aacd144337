// Where the depth maps of a capture come from, by the job's options.
#ifndef LITAGS_ENGINE_PIPELINE_DEPTH_MAPS_H_
#define LITAGS_ENGINE_PIPELINE_DEPTH_MAPS_H_

#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "engine/depth/depth_provider.h"
#include "engine/io/sparse_model.h"
#include "engine/pipeline/context.h"
#include "engine/pipeline/fingerprint.h"

namespace litags {

// The points with the tracks of the training photos alone, as indices into TrainSet::train: of
// `most` of them, spread over all (0: all). Stereo gives no map to the others.
std::vector<SparsePoint> PointsOfFew(absl::Span<const SparsePoint> points,
                                     absl::Span<const int> point_views, int most);

// Photos that stereo makes maps of for the depth loss; 0: all, since the user asked for stereo or
// the recipe has it so.
int StereoPhotos(const Recipe& recipe, const ReconstructOptions& options);

// The source that options.depth_source means for this input: kAuto becomes kMaps or kStereo. kNone
// if the recipe has no depth loss.
DepthOrigin ResolveDepthOrigin(const Recipe& recipe, const ReconstructOptions& options,
                               const ReconstructInput& input);
inline DepthOrigin ResolveDepthOrigin(const Context& context) {
  return ResolveDepthOrigin(context.recipe, context.options, context.input);
}

// If the maps in input.depth_dir cannot be those of the photos, by their names and first bytes:
// DEPTH_MAP_WITHOUT_PHOTO where none is of a photo, DEPTH_MAP_AMBIGUOUS, DEPTH_MAP_SIZE,
// DEPTH_FOLDER_MISSING, errors of ReadDepthSize. `notes` (may be null) gets one where maps may be
// of photos before EXIF turns them.
absl::Status CheckMapsFit(const CutInput& input, std::vector<std::string>* notes);

// What the views of a wide photo may be called.
std::vector<std::string> NamesOfViews(const std::string& photo);

// If the source has nothing to work with, before the cameras are searched for: INVALID_ARGUMENT
// (DEPTH_MAPS_MISSING, DEPTH_MODEL_MISSING), errors of CheckMapsFit. The report gets its notes.
absl::Status CheckDepthSource(const Context& context);

// What tells a network from another. Errors of its file.
absl::Status AddNetwork(const DepthNetwork& network, Fingerprint* f);

using DepthMaps = std::vector<std::optional<DepthMap>>;

// The maps of the training photos, none at all without a source. Fills depth_used and notes of the
// report. `points` are of the capture's model, `point_views` as in TrainSet. Maps of stereo and of
// a network are kept in work_dir/depth.litags and taken from there if they were made from the same
// photos, cameras and points (`key`), so that a resumed run has the very same. Where no training
// photo has one of the maps given, stereo makes them, with a note, if the source is kAuto.
// CheckDepthSource() passed. Errors of the source; INVALID_ARGUMENT: DEPTH_MAP_WITHOUT_PHOTO,
// DEPTH_MAP_EMPTY (all are), DEPTH_MAP_INVERSE (points that photos saw tell). Pixels that do not
// count by their photo's mask get no depth.
absl::StatusOr<DepthMaps> MakeDepthMaps(const Context& context,
                                        const std::vector<PosedPhoto>& photos,
                                        absl::Span<const SparsePoint> points,
                                        absl::Span<const int> point_views, const std::string& key);

}  // namespace litags

#endif  // LITAGS_ENGINE_PIPELINE_DEPTH_MAPS_H_
