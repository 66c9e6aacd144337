// A trained scene and the pictures of it.
#ifndef LITAGS_ENGINE_PIPELINE_SCENE_H_
#define LITAGS_ENGINE_PIPELINE_SCENE_H_

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "engine/core/camera.h"
#include "engine/core/cancel.h"
#include "engine/core/image.h"
#include "engine/export/export_request.h"

namespace litags {

enum class Channel {
  kColor,         // normal-lit R
  kOriginal,      // as photographed: R * L
  kLight,         // R * L^t, see RenderRequest::light
  kDepth,         // distance of surfaces along the axis, scene units, 0: nothing, 1 plane
  kStructure,     // 1 plane
  kIllumination,  // L, 3 planes
  kNoise,         // N_GS, 3 planes
  kAlpha,         // 1 plane
};

// Bounds of RenderRequest::light and ::exposure_stops, both ways.
constexpr double kMaxLight = 4, kMaxExposureStops = 10;

struct RenderRequest {
  Camera camera;  // validated by the callee
  Channel channel = Channel::kColor;
  double light = 0;  // t in R * L^t of kLight: 0 normal-lit, 1 as photographed, -4..4
  // The colour channels' linear light is multiplied by 2^stops before it is clamped, as a longer
  // or shorter exposure would; -10..10, 0 for all other channels.
  double exposure_stops = 0;
  int threads = 0;     // 0: all cores
  CancelToken cancel;  // looked at between the tiles of the picture
};

// A loaded scene. Immutable and safe to use from several threads.
class Scene {
 public:
  virtual ~Scene() = default;
  virtual const std::vector<View>& views() const = 0;  // training and held-out cameras, by name
  virtual int64_t num_gaussians() const = 0;
  virtual int iteration() const = 0;
  // Centre and radius of what the cameras look at, for orbits; scene units; `up` is unit length.
  virtual std::array<double, 3> center() const = 0;
  virtual std::array<double, 3> up() const = 0;
  virtual double radius() const = 0;
  // Float planes: 3 for colours (sRGB, clamped to [0, 1]), 1 otherwise as listed at Channel.
  // CANCELLED soon after the request's token is raised.
  virtual absl::StatusOr<Planes> Render(const RenderRequest& request) const = 0;
  // The scene as a file of request.format; returns how many Gaussians, points (SurfacePoints) or
  // triangles (SurfaceMesh) it holds. Gaussians: L is applied to every Gaussian instead of every
  // pixel, exposure to first order, and the denoiser is left out: viewers know none of them. Shapes
  // and opacities are such that what viewers draw in pictures of about the views' size is much like
  // Render's (viewer_splats.h), unless request.antialiased, or in a page, whose viewer knows the
  // filter. Where the cameras stand far from the origin, positions count from a point near them,
  // which is in the file where the format has a place for it: .ply and .compressed.ply ("comment
  // origin X Y Z"), .glb, .usda; .mesh.glb has its middle; COLMAP's models hold the sum in doubles.
  // INVALID_ARGUMENT: EXPORT_OPTION_INVALID, LIGHT_INVALID, EXPOSURE_INVALID; FAILED_PRECONDITION:
  // CHANNEL_UNAVAILABLE, EXPORT_EMPTY, EXPORT_OUT_OF_RANGE; CANCELLED.
  virtual absl::StatusOr<int64_t> Export(const std::string& path,
                                         const ExportRequest& request) const = 0;
  // A standard .ply, in the light R * L^t with t = `light`.
  absl::Status ExportPly(const std::string& path, double light) const {
    ExportRequest request;
    request.light = light;
    return Export(path, request).status();
  }
  // The Gaussians as they are, every LITA attribute as extra properties.
  virtual absl::Status ExportFullPly(const std::string& path) const = 0;
  // The scene as it is, for LoadScene().
  virtual absl::Status Save(const std::string& path) const = 0;
};

}  // namespace litags

#endif  // LITAGS_ENGINE_PIPELINE_SCENE_H_
