// Which SIFT features of two photos are each other's nearest: all dot products of their descriptors
// as one blocked matrix product in vector instructions.
#ifndef LITAGS_ENGINE_SFM_DESCRIPTOR_MATCH_H_
#define LITAGS_ENGINE_SFM_DESCRIPTOR_MATCH_H_

#include <cstddef>
#include <cstdint>
#include <vector>

#include "absl/types/span.h"
#include "engine/core/cancel.h"
#include "hwy/aligned_allocator.h"

namespace litags {

inline constexpr size_t kDescriptorSize = 128;

// Features by their row in each photo's descriptors; laid out as COLMAP's database stores them.
struct FeatureMatch {
  uint32_t index1 = 0, index2 = 0;

  friend bool operator==(const FeatureMatch&, const FeatureMatch&) = default;
};

// Two photos with fewer matches than this do not show the same: those are chance. COLMAP's own
// SiftMatching.min_num_inliers: it never verifies such a pair.
inline constexpr int kMinInliers = 15;

// COLMAP's tests and defaults (SiftMatching.max_distance, max_ratio; cross_check is on). Distances
// are angles: descriptors are unit vectors times 512, so d = acos(dot / 512^2).
struct MatchRule {
  float max_distance = 0.7f;  // radians, (0, pi/2)
  float max_ratio = 0.8f;     // of the distances to the nearest and the second nearest, (0, 1]
};

// For each descriptor of a photo the largest and the second largest product with those of another
// photo, equal where two are nearest. [n] each.
struct NearestProducts {
  std::vector<int32_t> best, second;  // the floor where no product is above it
  std::vector<int32_t> index;         // of the best, -1 if none is above the floor; any in a tie
};

// The descriptors of one photo as the product reads them: [panel][pair of dimensions][32 features],
// two int16 each. 256 bytes per feature.
class PackedDescriptors {
 public:
  // `descriptors` [n, 128].
  explicit PackedDescriptors(absl::Span<const uint8_t> descriptors);

  size_t size() const { return size_; }
  size_t num_panels() const;
  const int16_t* panel(size_t i) const;

 private:
  size_t size_;
  hwy::AlignedFreeUniquePtr<int16_t[]> data_;
};

// Nearest products of each of `a` in b, and of each of `b` in a, as far as above `floor` (>= 0).
// Ends early, with part of them, once cancelled.
void FindNearest(const PackedDescriptors& a, const PackedDescriptors& b, int32_t floor,
                 const CancelToken& cancel, NearestProducts* of_a, NearestProducts* of_b);

// Largest product that neither can be a match nor keep another from being one.
int32_t IrrelevantProduct(const MatchRule& rule);

// Pairs that are each other's nearest, near enough, and nearer than the second nearest by the
// ratio, in both directions; ascending by index1. None once cancelled.
std::vector<FeatureMatch> MatchDescriptors(const PackedDescriptors& a, const PackedDescriptors& b,
                                           const MatchRule& rule, const CancelToken& cancel);

}  // namespace litags

#endif  // LITAGS_ENGINE_SFM_DESCRIPTOR_MATCH_H_
