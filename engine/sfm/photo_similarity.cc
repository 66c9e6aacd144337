#include "engine/sfm/photo_similarity.h"

#include <algorithm>

#include "engine/core/parallel.h"
#include "engine/sfm/descriptor_match.h"

namespace litags {
namespace {

PackedDescriptors PackCoarse(absl::Span<const uint8_t> descriptors) {
  const size_t bytes = std::min(descriptors.size(), kCoarseFeatures * kDescriptorSize);
  return PackedDescriptors(descriptors.last(bytes));
}

}  // namespace

PhotoSimilarity CompareCoarseFeatures(absl::Span<const absl::Span<const uint8_t>> descriptors,
                                      int threads, const CancelToken& cancel) {
  std::vector<PackedDescriptors> coarse;
  coarse.reserve(descriptors.size());
  for (const absl::Span<const uint8_t> photo : descriptors) coarse.push_back(PackCoarse(photo));

  const int n = static_cast<int>(descriptors.size());
  PhotoSimilarity similarity(n);
  ParallelFor(threads, static_cast<size_t>(n), [&](size_t task, int) {
    const int i = static_cast<int>(task);
    for (int j = i + 1; j < n && !cancel.IsCancelled(); ++j) {
      const auto matches = MatchDescriptors(coarse[i], coarse[j], MatchRule(), cancel);
      similarity.Set(i, j, static_cast<int>(matches.size()));
    }
  });
  return similarity;
}

}  // namespace litags
