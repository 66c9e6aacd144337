// Which pairs of photos are compared in full.
#ifndef LITAGS_ENGINE_SFM_PAIR_CHOICE_H_
#define LITAGS_ENGINE_SFM_PAIR_CHOICE_H_

#include <cstdint>
#include <vector>

#include "absl/types/span.h"
#include "engine/core/cancel.h"
#include "engine/sfm/photo_similarity.h"
#include "engine/sfm/sfm.h"

namespace litags {

// Two photos, by index; first < second.
struct PhotoPair {
  int first = 0, second = 0;

  friend auto operator<=>(const PhotoPair&, const PhotoPair&) = default;
};

// Photos of a walk or of a video overlap with the next ones even where too little is seen to tell
// what they show.
inline constexpr int kNameNeighbours = 2;

// All pairs, ascending.
std::vector<PhotoPair> AllPairs(int num_photos);

// Each photo with its `count` most similar ones and, of those less similar, the ones at the ranks
// 2 count, 4 count, ... that still have matches: they see the same from farther apart. Of photos
// that are equally similar, the ones with the smaller index. Ascending.
std::vector<PhotoPair> SimilarPairs(const PhotoSimilarity& similarity, int count);

// The pairs that join all photos and are the most similar together: the maximum spanning tree
// (Prim). num_photos - 1 pairs, ascending.
std::vector<PhotoPair> SpanningPairs(const PhotoSimilarity& similarity);

// SimilarPairs() and SpanningPairs() of photos with these `descriptors` [photos][features, 128],
// coarse features last: the same pairs whatever the photos' order. Ascending. The result does not
// depend on options.threads; it is incomplete once cancelled.
std::vector<PhotoPair> PairsByContent(const SfmOptions& options,
                                      absl::Span<const std::vector<uint8_t>> descriptors,
                                      const CancelToken& cancel);

// The pairs to compare of photos in name order, ascending. Up to options.match_all_up_to photos
// AllPairs(), of more PairsByContent() and the kNameNeighbours next ones of each in name order.
std::vector<PhotoPair> PairsToMatch(const SfmOptions& options,
                                    absl::Span<const std::vector<uint8_t>> descriptors,
                                    const CancelToken& cancel);

}  // namespace litags

#endif  // LITAGS_ENGINE_SFM_PAIR_CHOICE_H_
