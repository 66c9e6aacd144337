// How alike photos are: what decides which pairs of a large capture are compared in full.
#ifndef LITAGS_ENGINE_SFM_PHOTO_SIMILARITY_H_
#define LITAGS_ENGINE_SFM_PHOTO_SIMILARITY_H_

#include <cstddef>
#include <cstdint>
#include <vector>

#include "absl/types/span.h"
#include "engine/core/cancel.h"

namespace litags {

// Features of a photo that CompareCoarseFeatures() compares. Half as many choose worse, twice as
// many take three times as long (docs/experiments/cameras.md).
inline constexpr size_t kCoarseFeatures = 128;

// A number per pair of photos, the larger, the more alike. Symmetric, [photos, photos].
class PhotoSimilarity {
 public:
  explicit PhotoSimilarity(int num_photos)
      : num_photos_(num_photos), values_(static_cast<size_t>(num_photos) * num_photos, 0) {}

  int num_photos() const { return num_photos_; }
  int At(int i, int j) const { return values_[Index(i, j)]; }
  void Set(int i, int j, int value) {
    values_[Index(i, j)] = values_[Index(j, i)] = static_cast<uint16_t>(value);
  }

 private:
  size_t Index(int i, int j) const { return static_cast<size_t>(i) * num_photos_ + j; }

  int num_photos_;
  std::vector<uint16_t> values_;
};

// Counts the matches (MatchDescriptors()) among the kCoarseFeatures coarsest features of each two
// photos. `descriptors` [photos][features, 128], the coarsest last, as COLMAP stores them.
//
// Coarse features are few, are seen from near and far, and survive noise; matches among them tell
// whether the rest is worth comparing. Source: Wu, "Towards Linear-time Incremental Structure from
// Motion", 3DV 2013, section 3 (preemptive matching).
//
// The result does not depend on `threads`; it is incomplete once cancelled.
PhotoSimilarity CompareCoarseFeatures(absl::Span<const absl::Span<const uint8_t>> descriptors,
                                      int threads, const CancelToken& cancel);

}  // namespace litags

#endif  // LITAGS_ENGINE_SFM_PHOTO_SIMILARITY_H_
