#include "engine/train/model.h"

#include <algorithm>

#include "absl/types/span.h"
#include "engine/core/parallel.h"

namespace litags {
namespace {

// Bounds what the lists of tiles take, 180 MB; a picture of a megapixel has about as many. Some 120
// bytes a Gaussian and 0.8 KB a tile come on top.
constexpr size_t kMaxPairs = size_t{1} << 22;

constexpr uint32_t kAll = ~uint32_t{0};

constexpr uint32_t Kept(int first, int count) { return ((1u << count) - 1) << first; }

bool Denoises(const Model& model) { return model.lita && model.use_pdm; }

void KeepPlanes(int count, Planes* planes) {
  planes->Reshape(count, planes->height, planes->width);
}

}  // namespace

void ModelRenderer::Composite(const Model& model, const Camera& camera, int num_channels,
                              uint32_t kept, Planes* channels, Planes* alpha, const Lamp& lamp) {
  RenderSettings settings;
  settings.num_channels = num_channels;
  settings.kept_channels = kept;
  settings.max_pairs = kMaxPairs;
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
  const int channels = Denoises(model) ? kColorAndNoise : kColorOnly;
  Composite(model, camera, channels, kAll, color, &alpha_, lamp);
  Denoise(model, color);
  KeepPlanes(3, color);
}

void ModelRenderer::RenderColorAndLight(const Model& model, const Camera& camera, Planes* both) {
  uint32_t kept = Kept(kChannelColor, 3) | Kept(kChannelIllumination, 3);
  if (Denoises(model)) kept |= Kept(kChannelNoise, 3);
  Composite(model, camera, Denoises(model) ? int{kNumChannels} : kWithoutNoise, kept, both,
            &alpha_);
  Denoise(model, both);
  KeepPlanes(6, both);
}

void ModelRenderer::RenderDepth(const Model& model, const Camera& camera, Planes* depth) {
  Composite(model, camera, kDepthOnly, kAll, depth, &alpha_);
}

void ModelRenderer::RenderChannels(const Model& model, const Camera& camera, int first, int count,
                                   Planes* channels) {
  Composite(model, camera, first + count <= kWithoutNoise ? kWithoutNoise : int{kNumChannels},
            Kept(first, count), channels, &alpha_);
}

void ModelRenderer::RenderAlpha(const Model& model, const Camera& camera, Planes* alpha) {
  Planes none;
  Composite(model, camera, kDepthOnly, 0, &none, alpha);
}

void ModelRenderer::Denoise(const Model& model, Planes* composited) {
  if (Cancelled()) return;
  const PlanesSpan color(*composited, kChannelColor, 3);
  if (Denoises(model)) {
    if (!pdm_.has_value() || pdm_->options() != model.pdm_options)
      pdm_.emplace(model.pdm_options, threads_);
    const PlanesView noise(*composited, composited->channels - 3, 3);
    pdm_->Apply(model.pdm, PlanesView(*composited, kChannelColor, 3), noise, &denoised_);
    std::copy_n(denoised_.data.data(), color.size(), color.data);
  }
  if (Cancelled()) return;
  if (model.noise.has_value()) noise_filter_.Apply(*model.noise, color);
  if (!model.curve.has_value()) return;
  const size_t row = color.width;
  ParallelFor(threads_, color.size() / row, [&](size_t i, int) {
    for (float& code : absl::MakeSpan(color.data + i * row, row)) {
      code = ApplyCurve(*model.curve, code);
    }
  });
}

}  // namespace litags
