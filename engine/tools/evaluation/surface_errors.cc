#include "engine/tools/evaluation/surface_errors.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/core/image.h"
#include "engine/core/quantile.h"
#include "engine/tools/evaluation/surface_distance.h"
#include "engine/tools/evaluation/true_depth.h"

namespace litags {
namespace {

constexpr char kField[] = "truth", kRemedy[] = "give the folder depth/ of litags-sample --truth";
constexpr float kEdge = 0.05f;  // of the depth. Choice: as of the pictures that meshes are made of

void AddMap(const Camera& camera, const Planes& depth, TrueSurface* truth) {
  constexpr uint32_t kNone = ~0u;
  TriangleMesh& mesh = truth->mesh;
  std::vector<uint32_t> number(depth.plane_size(), kNone);
  const auto at = [&](int x, int y) { return size_t(y) * depth.width + x; };
  for (int y = 0; y < depth.height; ++y) {
    for (int x = 0; x < depth.width; ++x) {
      const double z = depth.at(0, y, x);
      if (!(z > 0)) continue;
      number[at(x, y)] = static_cast<uint32_t>(mesh.vertices.size());
      mesh.vertices.push_back({camera.WorldFromCam(camera.Unproject(x + 0.5, y + 0.5, z)), {}});
      truth->depth.push_back(z);
    }
  }
  for (int y = 0; y + 1 < depth.height; ++y) {
    for (int x = 0; x + 1 < depth.width; ++x) {
      const size_t pixels[4] = {at(x, y), at(x + 1, y), at(x, y + 1), at(x + 1, y + 1)};
      float least = depth.data[pixels[0]], most = least;
      bool known = true;
      for (const size_t pixel : pixels) {
        known = known && number[pixel] != kNone;
        least = std::min(least, depth.data[pixel]);
        most = std::max(most, depth.data[pixel]);
      }
      if (!known || most > (1 + kEdge) * least) continue;
      const uint32_t corner[4] = {number[pixels[0]], number[pixels[1]], number[pixels[2]],
                                  number[pixels[3]]};
      mesh.triangles.push_back({corner[0], corner[2], corner[1]});
      mesh.triangles.push_back({corner[1], corner[2], corner[3]});
    }
  }
}

DistanceQuantiles QuantilesOf(std::vector<double> distances, std::vector<double> of_depth) {
  return {QuantileInPlace(distances, 0.5), QuantileInPlace(distances, 0.9),
          QuantileInPlace(of_depth, 0.5), QuantileInPlace(of_depth, 0.9)};
}

}  // namespace

absl::StatusOr<TrueSurface> ReadTrueSurface(const std::vector<View>& views,
                                            const std::string& dir) {
  TrueSurface truth;
  for (const View& view : views) {
    LITAGS_ASSIGN_OR_RETURN(const Planes depth, NeedTrueDepth(dir, view, kField, kRemedy));
    AddMap(view.camera, depth, &truth);
  }
  if (truth.mesh.vertices.empty()) {
    return InvalidInput("NO_TRUTH", kField,
                        absl::StrCat("the depth maps in ", dir, " know no pixel; ", kRemedy));
  }
  return truth;
}

SurfaceErrors MeasureSurface(const TriangleMesh& ours, const TrueSurface& truth, size_t step) {
  SurfaceErrors errors;
  std::vector<double> distances, of_depth;
  for (const NearestSurface& nearest : NearestOf(ours.vertices, truth.mesh)) {
    distances.push_back(nearest.distance);
    of_depth.push_back(nearest.distance / truth.depth[nearest.vertex]);
  }
  errors.accuracy = QuantilesOf(distances, of_depth);
  PointCloud queries;
  std::vector<double> depths;
  for (size_t i = 0; i < truth.mesh.vertices.size(); i += step) {
    queries.push_back(truth.mesh.vertices[i]);
    depths.push_back(truth.depth[i]);
  }
  const std::vector<NearestSurface> found = NearestOf(queries, ours);
  distances.clear();
  of_depth.clear();
  for (size_t i = 0; i < found.size(); ++i) {
    distances.push_back(found[i].distance);
    of_depth.push_back(found[i].distance / depths[i]);
  }
  errors.completeness = QuantilesOf(distances, of_depth);
  return errors;
}

}  // namespace litags
