// Features of several photos that are one point of the scene, from verified matches of pairs.
#ifndef LITAGS_ENGINE_SFM_TRACKS_H_
#define LITAGS_ENGINE_SFM_TRACKS_H_

#include <vector>

#include "absl/types/span.h"
#include "engine/sfm/photo_rays.h"

namespace litags {

// A feature: the photo, and its row there.
struct Observation {
  int photo = 0, feature = 0;

  friend auto operator<=>(const Observation&, const Observation&) = default;
};

// Verified matches of two photos, by index.
struct VerifiedPhotoPair {
  int photo1 = 0, photo2 = 0;
  std::vector<VerifiedMatch> matches;
};

// Which features are matched with which; features are numbered through all photos.
class MatchGraph {
 public:
  // `num_features` [photos].
  MatchGraph(const std::vector<int>& num_features, const std::vector<VerifiedPhotoPair>& pairs);

  int num_features() const { return first_of_photo_.back(); }
  int Id(const Observation& o) const { return first_of_photo_[o.photo] + o.feature; }
  Observation Of(int id) const;
  absl::Span<const int> Neighbours(int id) const;  // ascending

 private:
  std::vector<int> first_of_photo_;  // [photos + 1]
  std::vector<int> begin_, neighbours_;
};

// Joins matched features, those nearest to their epipolar lines first, and never two features of
// one photo. Tracks of at least two features, ascending by photo, in the order of their first
// feature.
std::vector<std::vector<Observation>> BuildTracks(const MatchGraph& graph,
                                                  const std::vector<VerifiedPhotoPair>& pairs);

}  // namespace litags

#endif  // LITAGS_ENGINE_SFM_TRACKS_H_
