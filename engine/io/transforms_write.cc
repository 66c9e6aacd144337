#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "engine/core/json_text.h"
#include "engine/io/file_util.h"
#include "engine/io/io_error.h"
#include "engine/io/transforms_io.h"

namespace litags {
namespace {

using Json = nlohmann::json;

Json PoseJson(const Camera& camera) {
  const std::array<double, 3> center = camera.Center();
  constexpr double kFlip[3] = {1, -1, -1};
  Json rows = Json::array();
  for (int r = 0; r < 3; ++r) {
    Json row = Json::array();
    for (int c = 0; c < 3; ++c) row.push_back(camera.R[3 * c + r] * kFlip[c]);
    row.push_back(center[r]);
    rows.push_back(std::move(row));
  }
  rows.push_back({0.0, 0.0, 0.0, 1.0});
  return rows;
}

// The angles repeat what the focal lengths say, for loaders that read nothing else.
Json IntrinsicsJson(const Camera& camera, const Distortion& d) {
  Json json = {{"camera_angle_x", 2 * std::atan(0.5 * camera.width / camera.fx)},
               {"camera_angle_y", 2 * std::atan(0.5 * camera.height / camera.fy)},
               {"fl_x", camera.fx},
               {"fl_y", camera.fy},
               {"cx", camera.cx},
               {"cy", camera.cy},
               {"w", camera.width},
               {"h", camera.height},
               {"k1", d.k1},
               {"k2", d.k2},
               {"p1", d.p1},
               {"p2", d.p2}};
  if (d.fisheye || d.IsFull()) {
    json.update({{"camera_model", d.fisheye ? "OPENCV_FISHEYE" : "FULL_OPENCV"},
                 {"k3", d.k3},
                 {"k4", d.k4},
                 {"k5", d.k5},
                 {"k6", d.k6}});
  }
  return json;
}

}  // namespace

std::string FormatTransforms(const SparseModel& model, std::string_view image_folder) {
  Json top = Json::object();
  std::vector<Json> intrinsics;
  bool shared = true;
  for (size_t i = 0; i < model.views.size(); ++i) {
    intrinsics.push_back(IntrinsicsJson(model.views[i].camera, model.distortions[i]));
    shared = shared && intrinsics[i] == intrinsics[0];
  }
  if (shared && !intrinsics.empty()) top = intrinsics[0];
  Json frames = Json::array();
  for (size_t i = 0; i < model.views.size(); ++i) {
    const std::string& name = model.views[i].name;
    Json frame = {
        {"file_path", image_folder.empty() ? name : absl::StrCat(Absl(image_folder), "/", name)}};
    if (!shared) frame.update(intrinsics[i]);
    frame["transform_matrix"] = PoseJson(model.views[i].camera);
    frames.push_back(std::move(frame));
  }
  top["frames"] = std::move(frames);
  return JsonText(top, 1) + "\n";
}

absl::Status WriteTransforms(const std::string& path, const SparseModel& model,
                             std::string_view image_folder) {
  return WriteFileAtomically(path, FormatTransforms(model, image_folder));
}

}  // namespace litags
