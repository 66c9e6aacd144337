#include "engine/sfm/pair_choice.h"

#include <algorithm>
#include <numeric>

namespace litags {
namespace {

PhotoPair MakePair(int i, int j) { return {std::min(i, j), std::max(i, j)}; }

void SortAndDropRepeats(std::vector<PhotoPair>& pairs) {
  std::sort(pairs.begin(), pairs.end());
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
}

// The other photos, the most similar to photo i first.
std::vector<int> RankPhotos(const PhotoSimilarity& similarity, int i) {
  std::vector<int> others(similarity.num_photos());
  std::iota(others.begin(), others.end(), 0);
  others.erase(others.begin() + i);
  std::stable_sort(others.begin(), others.end(),
                   [&](int a, int b) { return similarity.At(i, a) > similarity.At(i, b); });
  return others;
}

// The photos by what their features are, which their names do not change.
std::vector<int> OrderByContent(absl::Span<const std::vector<uint8_t>> descriptors) {
  std::vector<int> order(descriptors.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(),
                   [&](int a, int b) { return descriptors[a] < descriptors[b]; });
  return order;
}

void AddNameNeighbours(int num_photos, std::vector<PhotoPair>& pairs) {
  for (int i = 0; i < num_photos; ++i) {
    const int end = std::min(i + kNameNeighbours + 1, num_photos);
    for (int j = i + 1; j < end; ++j) pairs.push_back({i, j});
  }
}

}  // namespace

std::vector<PhotoPair> AllPairs(int num_photos) {
  std::vector<PhotoPair> pairs;
  for (int i = 0; i < num_photos; ++i) {
    for (int j = i + 1; j < num_photos; ++j) pairs.push_back({i, j});
  }
  return pairs;
}

std::vector<PhotoPair> SimilarPairs(const PhotoSimilarity& similarity, int count) {
  std::vector<PhotoPair> pairs;
  for (int i = 0; i < similarity.num_photos(); ++i) {
    const std::vector<int> ranked = RankPhotos(similarity, i);
    const size_t nearest = std::min(ranked.size(), static_cast<size_t>(count));
    for (size_t rank = 0; rank < nearest; ++rank) pairs.push_back(MakePair(i, ranked[rank]));
    for (size_t rank = 2 * nearest; rank < ranked.size(); rank *= 2) {
      if (similarity.At(i, ranked[rank]) == 0) break;
      pairs.push_back(MakePair(i, ranked[rank]));
    }
  }
  SortAndDropRepeats(pairs);
  return pairs;
}

std::vector<PhotoPair> SpanningPairs(const PhotoSimilarity& similarity) {
  const int n = similarity.num_photos();
  std::vector<int> nearest(n, 0);  // the photo in the tree that is most similar to this one
  std::vector<bool> in_tree(n, false);
  std::vector<PhotoPair> pairs;
  for (int added = 0, size = 1; size < n; ++size) {
    in_tree[added] = true;
    int next = -1;
    for (int i = 0; i < n; ++i) {
      if (in_tree[i]) continue;
      if (similarity.At(i, added) > similarity.At(i, nearest[i])) nearest[i] = added;
      if (next < 0 || similarity.At(i, nearest[i]) > similarity.At(next, nearest[next])) next = i;
    }
    pairs.push_back(MakePair(next, nearest[next]));
    added = next;
  }
  std::sort(pairs.begin(), pairs.end());
  return pairs;
}

std::vector<PhotoPair> PairsByContent(const SfmOptions& options,
                                      absl::Span<const std::vector<uint8_t>> descriptors,
                                      const CancelToken& cancel) {
  const std::vector<int> order = OrderByContent(descriptors);
  std::vector<absl::Span<const uint8_t>> ordered;
  for (const int photo : order) ordered.emplace_back(descriptors[photo]);
  const PhotoSimilarity similarity = CompareCoarseFeatures(ordered, options.threads, cancel);

  std::vector<PhotoPair> pairs = SimilarPairs(similarity, options.similar_photos);
  const std::vector<PhotoPair> spanning = SpanningPairs(similarity);
  pairs.insert(pairs.end(), spanning.begin(), spanning.end());
  for (PhotoPair& pair : pairs) pair = MakePair(order[pair.first], order[pair.second]);
  SortAndDropRepeats(pairs);
  return pairs;
}

std::vector<PhotoPair> PairsToMatch(const SfmOptions& options,
                                    absl::Span<const std::vector<uint8_t>> descriptors,
                                    const CancelToken& cancel) {
  const int n = static_cast<int>(descriptors.size());
  if (n <= options.match_all_up_to) return AllPairs(n);
  std::vector<PhotoPair> pairs = PairsByContent(options, descriptors, cancel);
  AddNameNeighbours(n, pairs);
  SortAndDropRepeats(pairs);
  return pairs;
}

}  // namespace litags
