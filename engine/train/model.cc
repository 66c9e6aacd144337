#include "engine/train/model.h"

#include <algorithm>

namespace litags {

void ModelRenderer::Composite(const Model& model, const Camera& camera, int num_channels,
                              Planes* channels, Planes* alpha) {
  RenderSettings settings;
  settings.num_channels = num_channels;
  settings.cancel = cancel_;
  settings.sh_degree = model.sh_degree;
  settings.depth_source = DepthSource::kCameraZ;
  settings.threads = threads_;
  renderer_.Forward(model.splats, camera, settings, channels, alpha);
}

void ModelRenderer::RenderColor(const Model& model, const Camera& camera, Planes* color) {
  const bool denoise = model.lita && model.use_pdm;
  Composite(model, camera, denoise ? kColorAndNoise : kColorOnly, denoise ? &composited_ : color,
            &alpha_);
  if (denoise) Denoise(model, composited_, color);
}

void ModelRenderer::RenderDepth(const Model& model, const Camera& camera, Planes* depth) {
  Composite(model, camera, kDepthOnly, depth, &alpha_);
}

void ModelRenderer::RenderChannels(const Model& model, const Camera& camera, Planes* channels,
                                   Planes* alpha) {
  Composite(model, camera, kNumChannels, channels, alpha);
}

void ModelRenderer::Denoise(const Model& model, const Planes& channels, Planes* color) {
  const bool denoise = model.lita && model.use_pdm && !(cancel_ && cancel_->IsCancelled());
  const PlanesView R0(channels, kChannelColor, 3);
  if (!denoise) {
    *color = Planes(3, channels.height, channels.width);
    std::copy_n(R0.data, R0.size(), color->data.data());
    return;
  }
  const PlanesView noise(channels, channels.channels == kColorAndNoise ? 3 : int{kChannelNoise}, 3);
  if (!pdm_.has_value() || pdm_->options() != model.pdm_options)
    pdm_.emplace(model.pdm_options, threads_);
  pdm_->Apply(model.pdm, R0, noise, color);
}

}  // namespace litags
