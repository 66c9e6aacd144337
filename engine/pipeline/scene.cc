#include "engine/pipeline/scene.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/io/ply.h"
#include "engine/pipeline/scene_file.h"

namespace litags {
namespace {

constexpr float kSh0 = 0.28209479f;  // SH basis 0

// R L^t per pixel and channel; L is kept off zero so that negative t stays finite.
Planes Relight(const Planes& color, const Planes& channels, double t) {
  Planes out = color;
  const float power = static_cast<float>(t);
  for (int c = 0; c < 3; ++c) {
    const float* L = channels.plane(kChannelIllumination + c);
    float* v = out.plane(c);
    for (size_t i = 0; i < out.plane_size(); ++i) v[i] *= std::pow(std::max(L[i], 1e-3f), power);
  }
  return out;
}

Planes Clamped(Planes planes) {
  for (float& v : planes.data) v = v > 0 ? std::min(v, 1.0f) : 0.0f;
  return planes;
}

Planes CopyOf(const Planes& from, int first, int count) {
  Planes out(count, from.height, from.width);
  std::copy_n(from.plane(first), count * from.plane_size(), out.data.data());
  return out;
}

// Composited depth over coverage; 0 where there is nothing.
Planes Depth(const ModelView& view) {
  Planes out = CopyOf(view.channels, kChannelDepth, 1);
  for (size_t i = 0; i < out.data.size(); ++i) {
    const float alpha = view.alpha.data[i];
    out.data[i] = alpha > 1e-3f ? out.data[i] / alpha : 0.0f;
  }
  return out;
}

// Colours times each Gaussian's illumination: c l = 0.5 + SH'.
Splats WithOriginalLight(const Splats& splats) {
  Splats out = splats;
  for (size_t i = 0; i < out.size(); ++i) {
    for (int c = 0; c < 3; ++c) {
      const float l = splats.at(i, kIllumination + c);
      float& dc = out.at(i, kShDc + c);
      dc = (l * (0.5f + kSh0 * dc) - 0.5f) / kSh0;
      for (int k = 1; k < 16; ++k) out.at(i, kShRest + 3 * (k - 1) + c) *= l;
    }
  }
  return out;
}

class ModelScene : public Scene {
 public:
  ModelScene(Model model, std::vector<View> views)
      : model_(std::move(model)), views_(std::move(views)), frame_(FrameOfViews(views_)) {}

  const std::vector<View>& views() const override { return views_; }
  int64_t num_gaussians() const override { return static_cast<int64_t>(model_.splats.size()); }
  int iteration() const override { return model_.iteration; }
  std::array<double, 3> center() const override { return frame_.center; }
  std::array<double, 3> up() const override { return frame_.up; }
  double radius() const override { return frame_.radius; }

  absl::StatusOr<Planes> Render(const RenderRequest& request) const override {
    LITAGS_RETURN_IF_ERROR(request.camera.Validate("camera"));
    if (!std::isfinite(request.exposure) || std::abs(request.exposure) > 8) {
      return InvalidInput("BAD_EXPOSURE", "exposure",
                          absl::StrCat("exposure: ", request.exposure, " is not in -8..8"));
    }
    if (!model_.lita && request.channel != Channel::kColor &&
        request.channel != Channel::kOriginal && request.channel != Channel::kAlpha) {
      return MakeError(
          absl::StatusCode::kFailedPrecondition, "CHANNEL_UNAVAILABLE", "channel",
          "channel: this scene was trained with plain 3dgs and has colour and alpha only; "
          "train with method litags for the others");
    }
    ModelRenderer renderer(request.threads);
    ModelView view;
    renderer.Render(model_, request.camera, DepthSource::kCameraZ, &view);
    switch (request.channel) {
      case Channel::kColor:
        return Clamped(std::move(view.color));
      case Channel::kOriginal:
        if (!model_.lita) return Clamped(std::move(view.color));
        return Clamped(Relight(view.color, view.channels, 1.0));
      case Channel::kExposure:
        return Clamped(Relight(view.color, view.channels, request.exposure));
      case Channel::kDepth:
        return Depth(view);
      case Channel::kStructure:
        return CopyOf(view.channels, kChannelStructure, 1);
      case Channel::kIllumination:
        return CopyOf(view.channels, kChannelIllumination, 3);
      case Channel::kNoise:
        return CopyOf(view.channels, kChannelNoise, 3);
      case Channel::kAlpha:
        return std::move(view.alpha);
    }
    return absl::InternalError("unknown channel");
  }

  absl::Status ExportPly(const std::string& path, bool original_light) const override {
    if (!original_light) return WritePly(path, model_.splats, /*lita_attributes=*/false);
    if (!model_.lita) {
      return MakeError(
          absl::StatusCode::kFailedPrecondition, "CHANNEL_UNAVAILABLE", "original_light",
          "original_light: this scene was trained with plain 3dgs and has one light only");
    }
    return WritePly(path, WithOriginalLight(model_.splats), /*lita_attributes=*/false);
  }

  absl::Status ExportFullPly(const std::string& path) const override {
    if (!model_.lita) {
      return MakeError(absl::StatusCode::kFailedPrecondition, "CHANNEL_UNAVAILABLE", "format",
                       "format: this scene was trained with plain 3dgs and has no LITA attributes; "
                       "export the standard .ply");
    }
    return WritePly(path, model_.splats, /*lita_attributes=*/true);
  }

 private:
  const Model model_;
  const std::vector<View> views_;
  const SceneFrame frame_;
};

}  // namespace

std::shared_ptr<const Scene> MakeScene(Model model, std::vector<View> views) {
  return std::make_shared<ModelScene>(std::move(model), std::move(views));
}

}  // namespace litags
