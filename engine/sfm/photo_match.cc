#include "engine/sfm/photo_match.h"

#include <atomic>
#include <map>
#include <utility>

#include "absl/types/span.h"
#include "engine/core/error.h"
#include "engine/core/parallel.h"
#include "engine/sfm/colmap_database.h"
#include "engine/sfm/descriptor_match.h"
#include "engine/sfm/pair_choice.h"

namespace litags {
namespace {

// Runs of pairs with one first photo, which is packed once for all of them.
std::vector<absl::Span<const PhotoPair>> GroupByFirst(const std::vector<PhotoPair>& pairs) {
  std::vector<absl::Span<const PhotoPair>> groups;
  for (size_t begin = 0, end = 0; begin < pairs.size(); begin = end) {
    while (end < pairs.size() && pairs[end].first == pairs[begin].first) ++end;
    groups.emplace_back(&pairs[begin], end - begin);
  }
  return groups;
}

// Matches of each of `pairs`; incomplete once cancelled.
std::vector<std::vector<FeatureMatch>> MatchPairs(
    const std::vector<std::vector<uint8_t>>& descriptors, const std::vector<PhotoPair>& pairs,
    int threads, const CancelToken& cancel, const std::function<void(double)>& progress) {
  std::vector<std::vector<FeatureMatch>> matches(pairs.size());
  const auto groups = GroupByFirst(pairs);
  std::atomic<size_t> done = 0;
  ParallelFor(threads, groups.size(), [&](size_t group, int thread) {
    if (cancel.IsCancelled()) return;
    const PackedDescriptors first(descriptors[groups[group][0].first]);
    for (const PhotoPair& pair : groups[group]) {
      if (cancel.IsCancelled()) return;
      const PackedDescriptors second(descriptors[pair.second]);
      matches[&pair - pairs.data()] = MatchDescriptors(first, second, MatchRule(), cancel);
      ++done;
      if (thread == 0) progress(static_cast<double>(done) / pairs.size());
    }
  });
  return matches;
}

}  // namespace

absl::StatusOr<std::vector<ImageMatches>> ComparePhotos(
    const std::string& database_path, const SfmOptions& options, const CancelToken& cancel,
    const std::function<void(double)>& progress) {
  LITAGS_ASSIGN_OR_RETURN(const auto images, ReadDatabaseImages(database_path));
  LITAGS_ASSIGN_OR_RETURN(const auto descriptors, ReadDescriptors(database_path, images));
  const std::vector<PhotoPair> pairs = PairsToMatch(options, descriptors, cancel);
  LITAGS_RETURN_IF_ERROR(cancel.Check());
  auto matches = MatchPairs(descriptors, pairs, options.threads, cancel, progress);
  LITAGS_RETURN_IF_ERROR(cancel.Check());

  std::vector<ImageMatches> kept;
  for (size_t i = 0; i < pairs.size(); ++i) {
    if (matches[i].size() < static_cast<size_t>(kMinInliers)) continue;
    kept.push_back({images[pairs[i].first].id, images[pairs[i].second].id, std::move(matches[i])});
  }
  return kept;
}

absl::StatusOr<std::vector<NamePair>> MatchPhotos(const std::string& database_path,
                                                  const SfmOptions& options,
                                                  const CancelToken& cancel,
                                                  const std::function<void(double)>& progress) {
  LITAGS_ASSIGN_OR_RETURN(const auto matches,
                          ComparePhotos(database_path, options, cancel, progress));
  LITAGS_RETURN_IF_ERROR(WriteMatches(database_path, matches));
  LITAGS_ASSIGN_OR_RETURN(const auto images, ReadDatabaseImages(database_path));
  std::map<int, std::string> name_of;
  for (const DatabaseImage& image : images) name_of[image.id] = image.name;
  std::vector<NamePair> names;
  for (const ImageMatches& pair : matches) names.push_back({name_of[pair.id1], name_of[pair.id2]});
  return names;
}

}  // namespace litags
