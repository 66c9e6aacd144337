#include "engine/sfm/rigs.h"

#include <Eigen/Core>
#include <algorithm>
#include <map>
#include <numeric>
#include <string>

namespace litags {
namespace {

using Rotation = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

Rotation ToEigen(const std::array<double, 9>& R) { return Eigen::Map<const Rotation>(R.data()); }

// The camera of a photo of the rig that `placed` belongs to.
Camera TurnedCamera(const Camera& placed, const RigView& from, const RigView& to,
                    const PhotoFile& photo) {
  Camera camera = {.width = photo.width,
                   .height = photo.height,
                   .fx = to.focal_length,
                   .fy = to.focal_length,
                   .cx = photo.width / 2.0,
                   .cy = photo.height / 2.0};
  const Rotation turn = ToEigen(to.R).transpose() * ToEigen(from.R);  // camera from placed one
  Eigen::Map<Rotation>(camera.R.data()) = turn * ToEigen(placed.R);
  Eigen::Map<Eigen::Vector3d>(camera.t.data()) =
      turn * Eigen::Map<const Eigen::Vector3d>(placed.t.data());
  return camera;
}

// For each rig, the view of the model with most points.
std::map<std::string, size_t> BestViews(const RigViews& rigs, const SparseModel& model) {
  std::vector<int> points(model.views.size(), 0);
  for (const SparsePoint& point : model.points) {
    for (const TrackElement& seen : point.track) ++points[static_cast<size_t>(seen.view)];
  }
  std::map<std::string, size_t> best;
  for (size_t i = 0; i < model.views.size(); ++i) {
    const auto view = rigs.find(model.views[i].name);
    if (view == rigs.end()) continue;
    size_t& kept = best.emplace(view->second.rig, i).first->second;
    if (points[i] > points[kept]) kept = i;
  }
  return best;
}

void SortViews(SparseModel* model) {
  std::vector<size_t> order(model->views.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::sort(order.begin(), order.end(),
            [&](size_t a, size_t b) { return model->views[a].name < model->views[b].name; });
  std::vector<View> views;
  std::vector<Distortion> distortions;
  std::vector<int> new_index(order.size());
  for (size_t i = 0; i < order.size(); ++i) {
    views.push_back(std::move(model->views[order[i]]));
    distortions.push_back(model->distortions[order[i]]);
    new_index[order[i]] = static_cast<int>(i);
  }
  model->views = std::move(views);
  model->distortions = std::move(distortions);
  for (SparsePoint& point : model->points) {
    for (TrackElement& seen : point.track) seen.view = new_index[static_cast<size_t>(seen.view)];
  }
}

}  // namespace

void PlaceRigViews(const RigViews& rigs, const std::vector<PhotoFile>& photos, SparseModel* model) {
  if (rigs.empty()) return;
  const std::map<std::string, size_t> best = BestViews(rigs, *model);
  std::map<std::string, bool> placed;
  for (const View& view : model->views) placed[view.name] = true;
  for (const PhotoFile& photo : photos) {
    const auto view = rigs.find(photo.name);
    if (view == rigs.end() || placed.contains(photo.name)) continue;
    const auto from = best.find(view->second.rig);
    if (from == best.end()) continue;
    const View& source = model->views[from->second];
    model->views.push_back(
        {photo.name, TurnedCamera(source.camera, rigs.at(source.name), view->second, photo)});
    model->distortions.emplace_back();
  }
  SortViews(model);
}

}  // namespace litags
