#include "engine/pipeline/export_scene.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "engine/core/color.h"
#include "engine/core/error.h"
#include "engine/export/formats.h"
#include "engine/pipeline/light_power.h"
#include "engine/pipeline/render_rules.h"
#include "engine/pipeline/scene_file.h"
#include "engine/pipeline/viewer_splats.h"
#include "engine/render/constants.h"

namespace litags {
namespace {

// Colours after a curve that pictures go through, to first order: its slope where the colour from
// all sides is applies to what depends on the side.
template <typename Curve>
void PutThrough(const Curve& curve, Splats* splats) {
  constexpr float kStep = 1.0f / 255;
  for (size_t i = 0; i < splats->size(); ++i) {
    for (int c = 0; c < 3; ++c) {
      float& dc = splats->at(i, kShDc + c);
      const float code = static_cast<float>(0.5 + kSh0 * dc);
      const float rise = curve(code + kStep) - curve(code - kStep);
      dc = static_cast<float>((curve(code) - 0.5) / kSh0);
      for (int k = 1; k < 16; ++k) splats->at(i, ShRow(k, c)) *= rise / (2 * kStep);
    }
  }
}

// Colours times each Gaussian's light to the power of t: c l^t = 0.5 + SH'.
void PutInLight(double t, Splats* splats) {
  for (size_t i = 0; i < splats->size(); ++i) {
    for (int c = 0; c < 3; ++c) {
      const float light = LightPower(splats->at(i, kIllumination + c), static_cast<float>(t));
      float& dc = splats->at(i, kShDc + c);
      dc = static_cast<float>((light * (0.5 + kSh0 * dc) - 0.5) / kSh0);
      for (int k = 1; k < 16; ++k) splats->at(i, ShRow(k, c)) *= light;
    }
  }
}

}  // namespace

absl::StatusOr<ViewerScene> MakeViewerScene(const Model& model, std::vector<View> views,
                                            const std::array<double, 3>& up,
                                            const ExportRequest& request) {
  LITAGS_RETURN_IF_ERROR(CheckExport(request));
  const bool mip = model.pixel_filter == PixelFilter::kMip;
  if (request.antialiased && !mip) {
    return MakeError(absl::StatusCode::kFailedPrecondition, "CHANNEL_UNAVAILABLE", "antialiased",
                     "antialiased: this scene was trained without; leave it out");
  }
  ViewerScene scene;
  scene.splats = model.splats;
  scene.sh_degree = model.sh_degree;
  scene.antialiased = mip;
  scene.near_plane = model.near_plane;
  scene.origin = model.origin;
  scene.cancel = request.cancel;
  if (model.curve.has_value()) {
    PutThrough([&](float code) { return ApplyCurve(*model.curve, code); }, &scene.splats);
  }
  if (request.light != 0) PutInLight(request.light, &scene.splats);
  if (request.exposure_stops != 0) {
    const double gain = std::exp2(request.exposure_stops);
    PutThrough(
        [gain](float code) {
          return static_cast<float>(SrgbFromLinear(gain * LinearFromSrgb(code)));
        },
        &scene.splats);
  }
  const SceneFrame frame = FrameOfViews(views);
  scene.center = frame.center;
  scene.up_direction = up;
  scene.radius = frame.radius;
  scene.views = std::move(views);
  if (request.crop.has_value()) Crop(*request.crop, &scene);
  if (scene.splats.size() == 0) {
    return MakeError(absl::StatusCode::kFailedPrecondition, "EXPORT_EMPTY",
                     request.crop.has_value() ? "crop" : "",
                     request.crop.has_value()
                         ? "crop: no Gaussian is in the box; its corners are in "
                           "the coordinates of the scene's cameras"
                         : "the scene has no Gaussians");
  }
  if (request.max_splats > 0) {
    LITAGS_RETURN_IF_ERROR(
        KeepHeaviest(request.max_splats, request.threads, request.cancel, &scene));
  }
  // After the weights: these are of smaller pictures than the changed Gaussians fit.
  // A page of its own brings a viewer that knows the filter, and the server's page takes its scenes
  // without the Mip filter from .compressed.ply, as trained.
  const float added = InfoOf(request.format).viewers_add;
  const bool changes = mip ? !request.antialiased && request.format != SceneFormat::kHtml
                           : added != kEps2d && request.format != SceneFormat::kCompressedPly;
  if (changes) {
    scene.splats = SplatsForViewers(scene.views, model.pixel_filter, added, std::move(scene.splats),
                                    request.threads, request.cancel);
    LITAGS_RETURN_IF_ERROR(request.cancel.Check());
    scene.antialiased = false;
  }
  const UpAxis axis = request.up == UpAxis::kOfFormat ? InfoOf(request.format).up : request.up;
  PlaceScene(up, axis, request.scale, &scene, request.threads);
  return scene;
}

}  // namespace litags
