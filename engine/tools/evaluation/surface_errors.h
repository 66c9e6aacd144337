// How far exported points and meshes are from exact surfaces.
#ifndef LITAGS_ENGINE_TOOLS_EVALUATION_SURFACE_ERRORS_H_
#define LITAGS_ENGINE_TOOLS_EVALUATION_SURFACE_ERRORS_H_

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "engine/core/camera.h"
#include "engine/export/triangle_mesh.h"

namespace litags {

// Exact surfaces, as far as cameras see them.
struct TrueSurface {
  TriangleMesh mesh;          // a vertex a pixel
  std::vector<double> depth;  // of each vertex in its picture, scene units
};

// From DIR/NAME.{pfm,npy,png} of every view, its exact depth along the axis: neighbouring pixels
// are joined by triangles unless their depths differ by more than 5 %. Not empty. INVALID_ARGUMENT:
// SIZE_MISMATCH; NO_TRUTH where a view has no map, or no map knows a pixel.
absl::StatusOr<TrueSurface> ReadTrueSurface(const std::vector<View>& views, const std::string& dir);

// Quantiles of distances.
struct DistanceQuantiles {
  double median = 0, ninety = 0;                    // scene units
  double median_of_depth = 0, ninety_of_depth = 0;  // distances over the true depth there
};

struct SurfaceErrors {
  DistanceQuantiles accuracy;      // from our vertices to the true surface
  DistanceQuantiles completeness;  // from every `step`-th vertex of the true surface to ours
};

// A point cloud is a mesh without triangles. Neither is empty.
SurfaceErrors MeasureSurface(const TriangleMesh& ours, const TrueSurface& truth, size_t step);

}  // namespace litags

#endif  // LITAGS_ENGINE_TOOLS_EVALUATION_SURFACE_ERRORS_H_
