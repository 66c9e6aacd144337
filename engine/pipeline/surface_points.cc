#include "engine/pipeline/surface_points.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "engine/core/error.h"
#include "engine/export/quantize.h"
#include "engine/pipeline/surface_pictures.h"
#include "engine/surface/grid.h"

namespace litags {
namespace {

using Point = std::array<double, 3>;

// What a pixel shows. 16 bytes: there are millions.
struct Sample {
  std::array<float, 3> from_center;
  std::array<uint8_t, 3> rgb;
  uint8_t camera;
};

void AddSamples(const SurfacePicture& picture, const ExportRequest& request, const Point& center,
                uint8_t number, std::vector<Sample>* samples) {
  for (int y = 0; y < picture.camera.height; ++y) {
    for (int x = 0; x < picture.camera.width; ++x) {
      if (!picture.Knows(x, y)) continue;
      const Point p = picture.PointAt(x, y);
      if (request.crop.has_value() && !request.crop->Holds(p)) continue;
      Sample& sample = samples->emplace_back();
      for (int k = 0; k < 3; ++k) {
        sample.from_center[k] = static_cast<float>(p[k] - center[k]);
        sample.rgb[k] = picture.color.pixel(x, y)[k];
      }
      sample.camera = number;
    }
  }
}

// The samples of one cube.
struct Cube {
  PointCloud::value_type mean;
  int64_t samples;
};

uint64_t CubeOf(const Sample& sample, double side) {
  std::array<int32_t, 3> cube;
  for (int k = 0; k < 3; ++k) {
    cube[k] = static_cast<int32_t>(std::floor(
        std::clamp(sample.from_center[k] / side, double(-kCubesAside), double(kCubesAside - 1))));
  }
  return CubeNumber(cube);
}

// The cubes that at least `cameras` cameras see.
std::vector<Cube> Cubes(const std::vector<Sample>& samples, double side, const Point& center,
                        int cameras) {
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

}  // namespace

absl::StatusOr<PointCloud> SurfacePoints(const Scene& scene, const ExportRequest& request) {
  LITAGS_ASSIGN_OR_RETURN(const std::vector<SurfacePicture> pictures,
                          SurfacePictures(scene, request));
  std::vector<Sample> samples;
  for (size_t i = 0; i < pictures.size(); ++i) {
    AddSamples(pictures[i], request, scene.center(), static_cast<uint8_t>(i), &samples);
  }
  const double side = kCubePixels * MedianPixelOf(pictures, request.crop).width;
  std::vector<Cube> cubes = Cubes(samples, side, scene.center(), LeastCameras(pictures));
  if (cubes.empty()) return NoSurface(request);
  KeepMostSeen(request.max_splats, &cubes);
  PointCloud points;
  for (const Cube& cube : cubes) points.push_back(cube.mean);
  PlacePoints(scene, request, &points);
  return points;
}

}  // namespace litags
