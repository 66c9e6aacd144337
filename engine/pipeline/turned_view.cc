#include "engine/pipeline/turned_view.h"

#include <Eigen/Core>
#include <algorithm>
#include <map>
#include <optional>
#include <set>
#include <utility>
#include <vector>

namespace litags {
namespace {

using Rotation = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

// Where the camera sees a point; nullopt: beside its picture or behind it.
std::optional<std::array<double, 2>> SeenAt(const Camera& camera,
                                            const std::array<double, 3>& point) {
  const std::array<double, 3> p = camera.CamFromWorld(point);
  if (!(p[2] > 0)) return std::nullopt;
  const auto [x, y] = camera.Project(p);
  if (!(x >= 0 && x <= camera.width && y >= 0 && y <= camera.height)) return std::nullopt;
  return std::array{x, y};
}

}  // namespace

Camera TurnedView(const Camera& camera, const CubeView& view, int side) {
  Camera out{.width = side, .height = side};
  out.fx = out.fy = out.cx = out.cy = side / 2.0;
  const Rotation turn = Eigen::Map<const Rotation>(view.R.data()).transpose();  // view from photo
  Eigen::Map<Rotation>(out.R.data()) = turn * Eigen::Map<const Rotation>(camera.R.data());
  Eigen::Map<Eigen::Vector3d>(out.t.data()) =
      turn * Eigen::Map<const Eigen::Vector3d>(camera.t.data());
  return out;
}

SparseModel CamerasOfViews(const WidePhotos& wide, const std::vector<ViewOfPhoto>& views) {
  const SparseModel& given = wide.cameras;
  std::set<int> cut;
  for (const WidePhoto& photo : wide.photos) cut.insert(photo.camera);
  std::vector<ViewOfPhoto> all = views;
  for (size_t i = 0; i < given.views.size(); ++i) {
    if (!cut.contains(static_cast<int>(i))) all.push_back({given.views[i], static_cast<int>(i)});
  }
  std::sort(all.begin(), all.end(),
            [](const auto& a, const auto& b) { return a.view.name < b.view.name; });
  SparseModel model;
  std::map<int, std::vector<int>> of_camera;  // of a given camera, views of the model
  for (const auto& [view, camera] : all) {
    of_camera[camera].push_back(static_cast<int>(model.views.size()));
    model.views.push_back(view);
    model.distortions.push_back(cut.contains(camera) ? Distortion() : given.distortions[camera]);
  }
  for (SparsePoint point : given.points) {
    std::vector<TrackElement> track;
    for (const TrackElement& seen : point.track) {
      for (const int view : of_camera[seen.view]) {
        const auto place = cut.contains(seen.view) ? SeenAt(model.views[view].camera, point.xyz)
                                                   : std::optional(std::array{seen.x, seen.y});
        if (!place.has_value()) continue;
        track.push_back({view, (*place)[0], (*place)[1]});
        break;
      }
    }
    point.track = std::move(track);
    model.points.push_back(std::move(point));
  }
  return model;
}

}  // namespace litags
