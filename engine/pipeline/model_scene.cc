#include "engine/pipeline/model_scene.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "engine/core/color.h"
#include "engine/core/error.h"
#include "engine/export/formats.h"
#include "engine/io/file_util.h"
#include "engine/io/ply.h"
#include "engine/pipeline/exception_status.h"
#include "engine/pipeline/export_scene.h"
#include "engine/pipeline/light_power.h"
#include "engine/pipeline/render_rules.h"
#include "engine/pipeline/scene_file.h"
#include "engine/pipeline/surface_mesh.h"
#include "engine/pipeline/surface_points.h"

namespace litags {
namespace {

// R L^t per pixel and channel, from the planes of R and L.
Planes Relit(Planes both, double t) {
  for (int c = 0; c < 3; ++c) {
    const float* L = both.plane(3 + c);
    float* v = both.plane(c);
    for (size_t i = 0; i < both.plane_size(); ++i) v[i] *= LightPower(L[i], static_cast<float>(t));
  }
  both.channels = 3;
  both.data.resize(3 * both.plane_size());
  return both;
}

// Linear light times 2^stops.
Planes Exposed(Planes color, double stops) {
  if (stops == 0) return color;
  const double gain = std::exp2(stops);
  for (float& v : color.data) {
    v = v > 0 ? static_cast<float>(SrgbFromLinear(gain * LinearFromSrgb(v))) : 0.0f;
  }
  return color;
}

Planes Clamped(Planes planes) {
  for (float& v : planes.data) v = v > 0 ? std::min(v, 1.0f) : 0.0f;
  return planes;
}

class ModelScene : public Scene {
 public:
  ModelScene(Model model, std::vector<View> views)
      : model_(std::move(model)), local_views_(std::move(views)), views_(local_views_) {
    for (View& view : views_) view.camera = view.camera.Moved(model_.origin);
    frame_ = FrameOfViews(local_views_);
    for (int k = 0; k < 3; ++k) frame_.center[k] += model_.origin[k];
  }

  const std::vector<View>& views() const override { return views_; }
  int64_t num_gaussians() const override { return static_cast<int64_t>(model_.splats.size()); }
  int iteration() const override { return model_.iteration; }
  std::array<double, 3> center() const override { return frame_.center; }
  std::array<double, 3> up() const override { return frame_.up; }
  double radius() const override { return frame_.radius; }

  absl::StatusOr<Planes> Render(const RenderRequest& request) const override {
    return WithoutExceptions([&] { return Picture(request); });
  }

  absl::StatusOr<int64_t> Export(const std::string& path,
                                 const ExportRequest& request) const override {
    return WithoutExceptions([&] { return Write(path, request); });
  }

  absl::Status ExportFullPly(const std::string& path) const override {
    return WithoutExceptions([&] { return WriteFullPly(path); });
  }

  absl::Status Save(const std::string& path) const override {
    return WithoutExceptions([&] { return SaveScene(path, model_, local_views_); });
  }

 private:
  absl::StatusOr<Planes> Picture(const RenderRequest& request) const {
    LITAGS_RETURN_IF_ERROR(request.camera.Validate("camera"));
    LITAGS_RETURN_IF_ERROR(CheckLight(request.light, "light"));
    LITAGS_RETURN_IF_ERROR(CheckExposure(request.exposure_stops, "exposure_stops"));
    if (request.exposure_stops != 0) {
      LITAGS_RETURN_IF_ERROR(CheckExposable(request.channel, "exposure_stops"));
    }
    const std::array<double, 3>& o = model_.origin;
    const Camera camera = request.camera.Moved({-o[0], -o[1], -o[2]});
    const bool other_light = request.channel == Channel::kLight && request.light != 0;
    if (!model_.lita &&
        (other_light || (!IsColor(request.channel) && request.channel != Channel::kDepth &&
                         request.channel != Channel::kAlpha))) {
      return MakeError(
          absl::StatusCode::kFailedPrecondition, "CHANNEL_UNAVAILABLE", "channel",
          "channel: this scene was trained with plain 3dgs and has colour, depth and alpha only; "
          "train with method litags for the others");
    }
    if (!model_.use_pdm && request.channel == Channel::kNoise) {
      return MakeError(absl::StatusCode::kFailedPrecondition, "CHANNEL_UNAVAILABLE", "channel",
                       "channel: this scene was trained without the denoising module, which learns "
                       "the noise; train with method litags-paper for it");
    }
    ModelRenderer renderer(request.threads, &request.cancel);
    if (IsColor(request.channel)) {
      Planes color = Color(&renderer, request, camera);
      LITAGS_RETURN_IF_ERROR(request.cancel.Check());
      return color;
    }
    Planes planes;
    switch (request.channel) {
      case Channel::kDepth:
        renderer.RenderDepth(model_, camera, &planes);
        break;
      case Channel::kStructure:
        renderer.RenderChannels(model_, camera, kChannelStructure, 1, &planes);
        break;
      case Channel::kIllumination:
        renderer.RenderChannels(model_, camera, kChannelIllumination, 3, &planes);
        break;
      case Channel::kNoise:
        renderer.RenderChannels(model_, camera, kChannelNoise, 3, &planes);
        break;
      case Channel::kAlpha:
        renderer.RenderAlpha(model_, camera, &planes);
        break;
      default:
        return absl::InternalError("unknown channel");
    }
    LITAGS_RETURN_IF_ERROR(request.cancel.Check());
    return planes;
  }

  absl::StatusOr<int64_t> Write(const std::string& path, const ExportRequest& request) const {
    LITAGS_RETURN_IF_ERROR(CheckExport(request));
    if (!model_.lita && request.light == 1) {  // that of the photos is its only one
      ExportRequest only = request;
      only.light = 0;
      return Write(path, only);
    }
    if (request.light != 0 && !model_.lita) {
      return MakeError(absl::StatusCode::kFailedPrecondition, "CHANNEL_UNAVAILABLE", "light",
                       "light: this scene was trained with plain 3dgs and has one light only");
    }
    if (const auto encode = InfoOf(request.format).encode_points) {
      LITAGS_ASSIGN_OR_RETURN(const PointCloud points, SurfacePoints(*this, request));
      LITAGS_RETURN_IF_ERROR(WriteFileAtomically(path, encode(points)));
      return static_cast<int64_t>(points.size());
    }
    if (const auto encode = InfoOf(request.format).encode_mesh) {
      LITAGS_ASSIGN_OR_RETURN(const TriangleMesh mesh, SurfaceMesh(*this, request));
      LITAGS_ASSIGN_OR_RETURN(const std::string bytes, encode(mesh));
      LITAGS_RETURN_IF_ERROR(WriteFileAtomically(path, bytes));
      return static_cast<int64_t>(mesh.triangles.size());
    }
    LITAGS_ASSIGN_OR_RETURN(const ViewerScene scene,
                            MakeViewerScene(model_, local_views_, frame_.up, request));
    LITAGS_RETURN_IF_ERROR(request.cancel.Check());
    LITAGS_ASSIGN_OR_RETURN(const std::string bytes, InfoOf(request.format).encode(scene));
    LITAGS_RETURN_IF_ERROR(WriteFileAtomically(path, bytes));
    return static_cast<int64_t>(scene.splats.size());
  }

  absl::Status WriteFullPly(const std::string& path) const {
    if (!model_.lita) {
      return MakeError(absl::StatusCode::kFailedPrecondition, "CHANNEL_UNAVAILABLE", "format",
                       "format: this scene was trained with plain 3dgs and has no LITA attributes; "
                       "export the standard .ply");
    }
    return WritePly(path, model_.splats, /*lita_attributes=*/true, model_.origin);
  }

  Planes Color(ModelRenderer* renderer, const RenderRequest& request, const Camera& camera) const {
    const double light = request.channel == Channel::kOriginal ? 1
                         : request.channel == Channel::kLight  ? request.light
                                                               : 0;
    Planes color;
    if (light == 0 || !model_.lita) {
      renderer->RenderColor(model_, camera, &color);
    } else {
      renderer->RenderColorAndLight(model_, camera, &color);
      color = Relit(std::move(color), light);
    }
    return Clamped(Exposed(std::move(color), request.exposure_stops));
  }

  const Model model_;
  const std::vector<View> local_views_;  // counted from the model's origin, as its Gaussians
  std::vector<View> views_;
  SceneFrame frame_;
};

}  // namespace

std::shared_ptr<const Scene> MakeScene(Model model, std::vector<View> views) {
  return std::make_shared<ModelScene>(std::move(model), std::move(views));
}

}  // namespace litags
