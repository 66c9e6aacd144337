#include "engine/pipeline/surface_points.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "engine/core/error.h"
#include "engine/export/formats.h"
#include "engine/export/quantize.h"
#include "engine/export/viewer_scene.h"
#include "engine/pipeline/render_rules.h"
#include "engine/target/median.h"

namespace litags {
namespace {

using Point = std::array<double, 3>;

constexpr size_t kMostCameras = 64;
constexpr double kMostSide = 640;         // px, of a picture
constexpr double kMostSamples = 4e6;      // pixels of all pictures
constexpr float kOpaque = 0.9f;           // least coverage of a pixel
constexpr float kEdge = 0.05f;            // of the depth, between neighbours
constexpr double kCubePixels = 1.5;       // side of a cube, in widths of a pixel, their median
constexpr int64_t kCubesAside = 1 << 20;  // of the centre: a cube's number has 21 bits an axis

// What a pixel shows. 20 bytes: there are millions.
struct Sample {
  std::array<float, 3> from_center;
  float width;  // of the pixel there
  std::array<uint8_t, 3> rgb;
  uint8_t camera;
};

struct Pictures {
  Planes depth, alpha, color;
};

Camera Shrunk(const Camera& camera, size_t cameras) {
  const double pixels = double(camera.width) * camera.height;
  const double share = std::min({1.0, kMostSide / std::max(camera.width, camera.height),
                                 std::sqrt(kMostSamples / cameras / pixels)});
  return camera.Scaled(std::max(1, static_cast<int>(share * camera.width)),
                       std::max(1, static_cast<int>(share * camera.height)));
}

absl::StatusOr<Pictures> Rendered(const Scene& scene, const Camera& camera,
                                  const ExportRequest& request) {
  RenderRequest picture;
  picture.camera = camera;
  picture.threads = request.threads;
  picture.cancel = request.cancel;
  Pictures out;
  picture.channel = Channel::kDepth;
  LITAGS_ASSIGN_OR_RETURN(out.depth, scene.Render(picture));
  picture.channel = Channel::kAlpha;
  LITAGS_ASSIGN_OR_RETURN(out.alpha, scene.Render(picture));
  picture.channel = request.light == 0 ? Channel::kColor : Channel::kLight;
  picture.light = request.light;
  picture.exposure_stops = request.exposure_stops;
  LITAGS_ASSIGN_OR_RETURN(out.color, scene.Render(picture));
  return out;
}

// Whether the pixel and its four neighbours are of one surface.
bool IsSurface(const Pictures& pictures, int x, int y) {
  const float depth = pictures.depth.at(0, y, x);
  if (!(depth > 0) || pictures.alpha.at(0, y, x) < kOpaque) return false;
  for (const auto& [dx, dy] : {std::pair{1, 0}, {-1, 0}, {0, 1}, {0, -1}}) {
    if (std::abs(pictures.depth.at(0, y + dy, x + dx) - depth) > kEdge * depth) return false;
  }
  return true;
}

void AddSamples(const Camera& camera, const Pictures& pictures, const ExportRequest& request,
                const Point& center, uint8_t number, std::vector<Sample>* samples) {
  for (int y = 1; y + 1 < camera.height; ++y) {
    for (int x = 1; x + 1 < camera.width; ++x) {
      if (!IsSurface(pictures, x, y)) continue;
      const double z = pictures.depth.at(0, y, x);
      const Point p = camera.WorldFromCam(
          {(x + 0.5 - camera.cx) / camera.fx * z, (y + 0.5 - camera.cy) / camera.fy * z, z});
      if (request.crop.has_value() && !request.crop->Holds(p)) continue;
      Sample& sample = samples->emplace_back();
      for (int k = 0; k < 3; ++k) {
        sample.from_center[k] = static_cast<float>(p[k] - center[k]);
        sample.rgb[k] = PackByte(255 * pictures.color.at(k, y, x));
      }
      sample.width = static_cast<float>(z / camera.fx);
      sample.camera = number;
    }
  }
}

double MedianWidth(const std::vector<Sample>& samples) {
  std::vector<double> widths;
  for (const Sample& sample : samples) widths.push_back(sample.width);
  return MedianInPlace(widths);
}

// The samples of one cube.
struct Cube {
  PointCloud::value_type mean;
  int64_t samples;
};

uint64_t CubeOf(const Sample& sample, double side) {
  uint64_t number = 0;
  for (const float x : sample.from_center) {
    const auto cube = static_cast<int64_t>(
        std::floor(std::clamp(x / side, double(-kCubesAside), double(kCubesAside - 1))));
    number = number << 21 | static_cast<uint64_t>(cube + kCubesAside);
  }
  return number;
}

// The cubes that at least `cameras` cameras see.
std::vector<Cube> Cubes(const std::vector<Sample>& samples, const Point& center, int cameras) {
  const double side = kCubePixels * MedianWidth(samples);
  std::vector<std::pair<uint64_t, uint32_t>> order;
  for (size_t i = 0; i < samples.size(); ++i) {
    order.emplace_back(CubeOf(samples[i], side), static_cast<uint32_t>(i));
  }
  std::sort(order.begin(), order.end());
  std::vector<Cube> cubes;
  for (size_t i = 0, end; i < order.size(); i = end) {
    Point sum = {}, light = {};
    int seen = 1;  // samples are in the order of their cameras
    for (end = i; end < order.size() && order[end].first == order[i].first; ++end) {
      const Sample& sample = samples[order[end].second];
      seen += end > i && sample.camera != samples[order[end - 1].second].camera;
      for (int k = 0; k < 3; ++k) {
        sum[k] += sample.from_center[k];
        light[k] += sample.rgb[k];
      }
    }
    if (seen < cameras) continue;
    Cube& cube = cubes.emplace_back();
    cube.samples = static_cast<int64_t>(end - i);
    for (int k = 0; k < 3; ++k) {
      cube.mean.xyz[k] = center[k] + sum[k] / cube.samples;
      cube.mean.rgb[k] = PackByte(light[k] / cube.samples);
    }
  }
  return cubes;
}

void KeepMostSeen(int64_t count, std::vector<Cube>* cubes) {
  if (count <= 0 || static_cast<size_t>(count) >= cubes->size()) return;
  std::stable_sort(cubes->begin(), cubes->end(),
                   [](const Cube& a, const Cube& b) { return a.samples > b.samples; });
  cubes->resize(static_cast<size_t>(count));
}

// As PlaceScene does with Gaussians.
void Place(const Point& up, UpAxis axis, double scale, PointCloud* points) {
  const Matrix3 r = RotationTo(up, axis);
  for (ColoredPoint& point : *points) {
    const Point p = point.xyz;
    for (int k = 0; k < 3; ++k) {
      point.xyz[k] = scale * (r[3 * k] * p[0] + r[3 * k + 1] * p[1] + r[3 * k + 2] * p[2]);
    }
  }
}

}  // namespace

absl::StatusOr<PointCloud> SurfacePoints(const Scene& scene, const ExportRequest& request) {
  LITAGS_RETURN_IF_ERROR(CheckExport(request));
  const std::vector<View>& views = scene.views();
  const size_t cameras = std::min(views.size(), kMostCameras);
  std::vector<Sample> samples;
  for (size_t i = 0; i < cameras; ++i) {
    const Camera camera = Shrunk(views[i * views.size() / cameras].camera, cameras);
    LITAGS_ASSIGN_OR_RETURN(const Pictures pictures, Rendered(scene, camera, request));
    AddSamples(camera, pictures, request, scene.center(), static_cast<uint8_t>(i), &samples);
  }
  std::vector<Cube> cubes;
  if (!samples.empty()) cubes = Cubes(samples, scene.center(), cameras > 1 ? 2 : 1);
  if (cubes.empty()) {
    return MakeError(absl::StatusCode::kFailedPrecondition, "EXPORT_EMPTY",
                     request.crop.has_value() ? "crop" : "",
                     request.crop.has_value()
                         ? "crop: no surface that two cameras see is in the box; its corners are "
                           "in the coordinates of the scene's cameras"
                         : "the scene has no surface that two of its cameras see");
  }
  KeepMostSeen(request.max_splats, &cubes);
  PointCloud points;
  for (const Cube& cube : cubes) points.push_back(cube.mean);
  const UpAxis axis = request.up == UpAxis::kOfFormat ? InfoOf(request.format).up : request.up;
  Place(scene.up(), axis, request.scale, &points);
  return points;
}

}  // namespace litags
