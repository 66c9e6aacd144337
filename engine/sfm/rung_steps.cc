#include "engine/sfm/rung_steps.h"

#include <map>
#include <string>

#include "engine/core/error.h"
#include "engine/core/monotonic_seconds.h"
#include "engine/sfm/photo_set.h"

namespace litags {

absl::Status PrepareAndExtract(const RungInput& in, Colmap& colmap, SfmRung& rung) {
  rung.preparation = PreparationName(in.preparation);
  const double start = MonotonicSeconds();
  in.report("prepare", 0);
  LITAGS_RETURN_IF_ERROR(WriteCopies(in.images_dir, in.photos, in.preparation, colmap.images_dir(),
                                     colmap.masks_dir(), in.options.threads, in.cancel,
                                     [&](double f) { in.report("prepare", f); }));
  rung.prepare_seconds = MonotonicSeconds() - start;
  in.report("features", 0);
  LITAGS_ASSIGN_OR_RETURN(rung.feature_seconds, colmap.ExtractFeatures(in.photos, [&](double f) {
    in.report("features", f);
  }));
  std::vector<std::string> names;
  std::vector<std::pair<std::string, double>> known;
  for (const PhotoFile& photo : in.photos) {
    names.push_back(photo.copy_name);
    if (photo.copy_focal_length > 0) known.emplace_back(names.back(), photo.copy_focal_length);
  }
  LITAGS_RETURN_IF_ERROR(NumberImages(colmap.database_path(), names));
  return SetFocalLengths(colmap.database_path(), known);
}

absl::StatusOr<std::vector<SfmPhoto>> PhotoFacts(const RungInput& in,
                                                 const std::vector<DatabaseImage>& images,
                                                 const std::vector<VerifiedPair>& pairs) {
  std::vector<SfmPhoto> facts(in.photos.size());
  std::map<std::string, int> index;
  for (size_t i = 0; i < facts.size(); ++i) {
    facts[i].name = in.photos[i].name;
    index[in.photos[i].copy_name] = static_cast<int>(i);
  }
  std::map<int, int> photo_of_id;
  for (const DatabaseImage& image : images) {
    const auto found = index.find(image.name);
    if (found == index.end()) continue;
    photo_of_id[image.id] = found->second;
    facts[found->second].features = image.features;
  }
  for (const VerifiedPair& pair : pairs) {
    for (const int id : {pair.id1, pair.id2}) {
      const auto found = photo_of_id.find(id);
      if (found != photo_of_id.end()) ++facts[found->second].matched_photos;
    }
  }
  return facts;
}

void ScaleTracks(const std::vector<PhotoFile>& photos, const std::vector<int>& photo_of,
                 SparseModel& model) {
  for (SparsePoint& point : model.points) {
    for (TrackElement& seen : point.track) {
      const PhotoFile& photo = photos[photo_of[seen.view]];
      seen.x = seen.x * photo.shown.width / photo.copy_width + photo.shown.x;
      seen.y = seen.y * photo.shown.height / photo.copy_height + photo.shown.y;
    }
  }
}

}  // namespace litags
