#include "engine/train/model.h"

#include <algorithm>

namespace litags {

void CopyPlanes(const Planes& from, int first, Planes* to) {
  to->channels = 3;
  to->height = from.height;
  to->width = from.width;
  to->data.assign(from.plane(first), from.plane(first) + 3 * from.plane_size());
}

void ModelRenderer::Render(const Model& model, const Camera& camera, DepthSource depth_source,
                           ModelView* out) {
  RenderSettings settings;
  settings.num_channels = model.lita ? int{kNumChannels} : 3;
  settings.sh_degree = model.sh_degree;
  settings.depth_source = depth_source;
  settings.threads = threads_;
  renderer_.Forward(model.splats, camera, settings, &out->channels, &out->alpha);
  CopyPlanes(out->channels, kChannelColor, &out->color);
  if (!model.lita || !model.use_pdm) return;
  CopyPlanes(out->channels, kChannelNoise, &noise_);
  if (!pdm_.has_value() || pdm_->options() != model.pdm_options)
    pdm_.emplace(model.pdm_options, threads_);
  pdm_->Forward(model.pdm, out->color, noise_);
  out->color = pdm_->R(model.pdm_options.stages);
}

}  // namespace litags
