// What a scene is written as for other programs.
#ifndef LITAGS_ENGINE_EXPORT_EXPORT_REQUEST_H_
#define LITAGS_ENGINE_EXPORT_EXPORT_REQUEST_H_

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>

#include "engine/core/cancel.h"

namespace litags {

// File formats; formats.h has a row of each. Those from kPoints on hold points of surfaces, those
// from kMeshPly on triangles, the others Gaussians.
enum class SceneFormat {
  kPly,
  kCompressedPly,
  kSplat,
  kSpz,
  kSpzV4,
  kSog,
  kGlb,
  kUsda,
  kColmap,
  kHtml,
  kPoints,
  kLas,
  kMeshPly,
  kMeshGlb
};

// Which axis of the file the scene's up direction becomes.
enum class UpAxis {
  kOfFormat,  // what the format says, else kKeep
  kKeep,      // the scene is not turned
  kX,
  kNegativeX,
  kY,
  kNegativeY,
  kZ,
  kNegativeZ,
};

struct Box {
  bool Holds(const std::array<double, 3>& point) const {
    bool inside = true;
    for (int k = 0; k < 3; ++k) inside = inside && point[k] >= min[k] && point[k] <= max[k];
    return inside;
  }
  double LongestSide() const {
    return std::max({max[0] - min[0], max[1] - min[1], max[2] - min[2]});
  }

  std::array<double, 3> min = {}, max = {};  // in the scene's coordinates
};

// Bounds of ExportRequest::scale.
constexpr double kMinExportScale = 1e-6, kMaxExportScale = 1e6;

struct ExportRequest {
  SceneFormat format = SceneFormat::kPly;
  double light = 0;           // t in R * L^t, -4..4
  double exposure_stops = 0;  // linear light times 2^stops, -10..10
  UpAxis up = UpAxis::kOfFormat;
  double scale = 1;         // units of the file in one of the scene
  std::optional<Box> crop;  // only Gaussians whose centre is inside, or surfaces
  int64_t max_splats = 0;   // of those, the ones that pictures need most; 0: all; not of meshes
  // Small Gaussians as they were trained, and the format's tag that viewers are to draw them
  // antialiased. Else they are such that viewers without that draw them much as we do.
  bool antialiased = false;
  int threads = 0;  // <= 0: all cores
  CancelToken cancel;
};

}  // namespace litags

#endif  // LITAGS_ENGINE_EXPORT_EXPORT_REQUEST_H_
