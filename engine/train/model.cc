#include "engine/train/model.h"

#include <algorithm>

#include "absl/types/span.h"
#include "engine/core/parallel.h"

namespace litags {
namespace {

void CopyColor(const Planes& channels, Planes* color) {
  const PlanesView R0(channels, kChannelColor, 3);
  *color = Planes(3, channels.height, channels.width);
  std::copy_n(R0.data, R0.size(), color->data.data());
}

}  // namespace

void ModelRenderer::Composite(const Model& model, const Camera& camera, int num_channels,
                              Planes* channels, Planes* alpha, const Lamp& lamp) {
  RenderSettings settings;
  settings.num_channels = num_channels;
  settings.cancel = cancel_;
  settings.sh_degree = model.sh_degree;
  settings.depth_source = DepthSource::kCameraZ;
  settings.pixel_filter = model.pixel_filter;
  settings.near_plane = model.near_plane;
  settings.lamp = lamp;
  settings.threads = threads_;
  renderer_.Forward(model.splats, camera, settings, channels, alpha);
}

void ModelRenderer::RenderColor(const Model& model, const Camera& camera, Planes* color,
                                const Lamp& lamp) {
  const bool denoise = model.lita && model.use_pdm;
  Composite(model, camera, denoise ? kColorAndNoise : kColorOnly, denoise ? &composited_ : color,
            &alpha_, lamp);
  if (denoise) ApplyPdm(model, composited_, color);
  Finish(model, color);
}

void ModelRenderer::RenderDepth(const Model& model, const Camera& camera, Planes* depth) {
  Composite(model, camera, kDepthOnly, depth, &alpha_);
}

void ModelRenderer::RenderChannels(const Model& model, const Camera& camera, Planes* channels,
                                   Planes* alpha) {
  Composite(model, camera, model.use_pdm ? int{kNumChannels} : kWithoutNoise, channels, alpha);
}

void ModelRenderer::Denoise(const Model& model, const Planes& channels, Planes* color) {
  if (model.lita && model.use_pdm) {
    ApplyPdm(model, channels, color);
  } else {
    CopyColor(channels, color);
  }
  Finish(model, color);
}

void ModelRenderer::ApplyPdm(const Model& model, const Planes& channels, Planes* color) {
  if (Cancelled()) return CopyColor(channels, color);
  const PlanesView R0(channels, kChannelColor, 3);
  const PlanesView noise(channels, channels.channels == kColorAndNoise ? 3 : int{kChannelNoise}, 3);
  if (!pdm_.has_value() || pdm_->options() != model.pdm_options)
    pdm_.emplace(model.pdm_options, threads_);
  pdm_->Apply(model.pdm, R0, noise, color);
}

void ModelRenderer::Finish(const Model& model, Planes* color) {
  if (Cancelled()) return;
  if (model.noise.has_value()) noise_filter_.Apply(*model.noise, *color);
  if (!model.curve.has_value()) return;
  const size_t row = color->width;
  ParallelFor(threads_, color->data.size() / row, [&](size_t i, int) {
    for (float& code : absl::MakeSpan(color->data.data() + i * row, row)) {
      code = ApplyCurve(*model.curve, code);
    }
  });
}

}  // namespace litags
