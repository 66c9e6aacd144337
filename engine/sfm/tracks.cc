#include "engine/sfm/tracks.h"

#include <algorithm>
#include <numeric>
#include <tuple>

namespace litags {
namespace {

struct Edge {
  int id1, id2;
  double error;
};

// Sets of features with at most one per photo.
class TrackSets {
 public:
  explicit TrackSets(const MatchGraph& graph)
      : parent_(graph.num_features()), photos_(parent_.size()) {
    std::iota(parent_.begin(), parent_.end(), 0);
    for (size_t id = 0; id < photos_.size(); ++id) {
      photos_[id] = {graph.Of(static_cast<int>(id)).photo};
    }
  }

  int Find(int id) {
    while (parent_[id] != id) id = parent_[id] = parent_[parent_[id]];
    return id;
  }

  void JoinUnlessTheyShareAPhoto(int id1, int id2) {
    int a = Find(id1), b = Find(id2);
    if (a == b) return;
    if (photos_[a].size() < photos_[b].size()) std::swap(a, b);
    std::vector<int> joined;
    std::set_union(photos_[a].begin(), photos_[a].end(), photos_[b].begin(), photos_[b].end(),
                   std::back_inserter(joined));
    if (joined.size() < photos_[a].size() + photos_[b].size()) return;
    photos_[a] = std::move(joined);
    photos_[b] = {};
    parent_[b] = a;
  }

 private:
  std::vector<int> parent_;
  std::vector<std::vector<int>> photos_;  // of each root, ascending
};

}  // namespace

MatchGraph::MatchGraph(const std::vector<int>& num_features,
                       const std::vector<VerifiedPhotoPair>& pairs)
    : first_of_photo_(num_features.size() + 1) {
  std::partial_sum(num_features.begin(), num_features.end(), first_of_photo_.begin() + 1);
  std::vector<std::pair<int, int>> edges;
  for (const VerifiedPhotoPair& pair : pairs) {
    for (const VerifiedMatch& match : pair.matches) {
      const int id1 = Id({pair.photo1, match.feature1}), id2 = Id({pair.photo2, match.feature2});
      edges.emplace_back(id1, id2);
      edges.emplace_back(id2, id1);
    }
  }
  std::sort(edges.begin(), edges.end());
  begin_.resize(this->num_features() + 1);
  neighbours_.reserve(edges.size());
  for (const auto& [from, to] : edges) {
    ++begin_[from + 1];
    neighbours_.push_back(to);
  }
  std::partial_sum(begin_.begin(), begin_.end(), begin_.begin());
}

Observation MatchGraph::Of(int id) const {
  const auto after = std::upper_bound(first_of_photo_.begin(), first_of_photo_.end(), id);
  const int photo = static_cast<int>(after - first_of_photo_.begin()) - 1;
  return {photo, id - first_of_photo_[photo]};
}

absl::Span<const int> MatchGraph::Neighbours(int id) const {
  return absl::MakeConstSpan(neighbours_).subspan(begin_[id], begin_[id + 1] - begin_[id]);
}

std::vector<std::vector<Observation>> BuildTracks(const MatchGraph& graph,
                                                  const std::vector<VerifiedPhotoPair>& pairs) {
  std::vector<Edge> edges;
  for (const VerifiedPhotoPair& pair : pairs) {
    for (const VerifiedMatch& match : pair.matches) {
      edges.push_back({graph.Id({pair.photo1, match.feature1}),
                       graph.Id({pair.photo2, match.feature2}), match.error});
    }
  }
  std::sort(edges.begin(), edges.end(), [](const Edge& a, const Edge& b) {
    return std::tie(a.error, a.id1, a.id2) < std::tie(b.error, b.id1, b.id2);
  });
  TrackSets sets(graph);
  for (const Edge& edge : edges) sets.JoinUnlessTheyShareAPhoto(edge.id1, edge.id2);

  std::vector<int> track_of_root(graph.num_features(), -1);
  std::vector<std::vector<Observation>> tracks;
  for (int id = 0; id < graph.num_features(); ++id) {
    if (graph.Neighbours(id).empty()) continue;
    int& track = track_of_root[sets.Find(id)];
    if (track < 0) {
      track = static_cast<int>(tracks.size());
      tracks.emplace_back();
    }
    tracks[track].push_back(graph.Of(id));
  }
  std::erase_if(tracks, [](const auto& track) { return track.size() < 2; });
  return tracks;
}

}  // namespace litags
