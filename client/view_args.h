// Cameras and pictures in words of the command line, turned into requests.
#ifndef LITAGS_CLIENT_VIEW_ARGS_H_
#define LITAGS_CLIENT_VIEW_ARGS_H_

#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "litags/v1/render_service.pb.h"

namespace litags::client {

// What `litags render` and `litags path` say about a picture. Empty: not given.
struct SettingsArgs {
  std::string size;  // "640x480"; "640x" or "x480": the other follows
  std::optional<double> fov_deg;
  std::string intrinsics;          // "fx,fy,cx,cy"
  std::string channel;             // "color", "depth", ...
  std::optional<double> light;     // t in R * L^t
  std::optional<double> exposure;  // stops
  int jpeg_quality = 0;
};

struct PoseArgs {
  std::string camera;
  std::vector<std::string> pose;     // 16 numbers, together or apart, or one file that holds them
  std::vector<std::string> look_at;  // eye and target, each "x,y,z"
  std::string up;                    // "x,y,z"
};

// Errors: INVALID_ARGUMENT with the option as field. What the numbers may be is left to the
// server, so NaN is passed on.
absl::StatusOr<v1::RenderSettings> ParseSettings(const SettingsArgs& args);
absl::StatusOr<v1::Pose> ParsePose(const PoseArgs& args);

// Three numbers separated by spaces, commas, semicolons or brackets. INVALID_ARGUMENT
// (NUMBER_INVALID, VECTOR_INVALID) naming `field`.
absl::StatusOr<v1::Vector3> ParseVector(const std::string& text, const std::string& field);

}  // namespace litags::client

#endif  // LITAGS_CLIENT_VIEW_ARGS_H_
