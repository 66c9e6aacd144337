// A trained scene and how to render it.
#ifndef LITAGS_ENGINE_TRAIN_MODEL_H_
#define LITAGS_ENGINE_TRAIN_MODEL_H_

#include <array>
#include <optional>

#include "engine/core/camera.h"
#include "engine/core/code_curve.h"
#include "engine/core/image.h"
#include "engine/core/splats.h"
#include "engine/denoise/noise_filter.h"
#include "engine/denoise/pdm.h"
#include "engine/render/renderer.h"

namespace litags {

struct Model {
  Splats splats;
  std::array<double, 3> origin = {};  // of their coordinates, in those of the user's cameras
  bool lita = true;                   // has the LITA attributes; else plain 3DGS
  bool use_pdm = true;
  PdmOptions pdm_options;
  PdmWeights pdm;
  std::optional<NoiseCurve> noise;  // for the NoiseFilter that pictures go through; none: no filter
  std::optional<CodeCurve> curve;   // that finished pictures go through, last; none: as they are
  PixelFilter pixel_filter = PixelFilter::kDilate;  // that it was trained with
  float near_plane = RenderSettings().near_plane;   // that it was trained with
  int sh_degree = 3;                                // in use
  int iteration = 0;
};

// Renders views of a model, keeping buffers between calls. Not thread-safe.
class ModelRenderer {
 public:
  // Once `cancel`, which must outlive this, is raised, pictures are left unfinished.
  explicit ModelRenderer(int threads, const CancelToken* cancel = nullptr)
      : threads_(threads), cancel_(cancel), noise_filter_(threads) {}

  // R [3, H, W], after the PDM, the noise filter and the curve; not clamped. Composites what it
  // needs and no more. With a lamp: as a photo by its light.
  void RenderColor(const Model& model, const Camera& camera, Planes* color, const Lamp& lamp = {});

  // Distance of the surfaces along the optical axis [1, H, W], scene units; 0 where nothing is.
  void RenderDepth(const Model& model, const Camera& camera, Planes* depth);

  // R, as RenderColor, and L_r: [6, H, W].
  void RenderColorAndLight(const Model& model, const Camera& camera, Planes* both);

  // `count` channels from `first` on, see RenderChannel, with CameraZ as depth [count, H, W]. Those
  // of the attributes mean nothing for plain 3DGS, and the noise nothing without a denoiser.
  void RenderChannels(const Model& model, const Camera& camera, int first, int count,
                      Planes* channels);

  // How much the Gaussians cover of every pixel [1, H, W].
  void RenderAlpha(const Model& model, const Camera& camera, Planes* alpha);

 private:
  void Composite(const Model& model, const Camera& camera, int num_channels, uint32_t kept,
                 Planes* channels, Planes* alpha, const Lamp& lamp = {});
  // The first three planes of `composited` become R; its last three are the noise of a model with
  // a denoiser.
  void Denoise(const Model& model, Planes* composited);
  bool Cancelled() const { return cancel_ != nullptr && cancel_->IsCancelled(); }

  int threads_;
  const CancelToken* cancel_;
  Renderer renderer_;
  std::optional<Pdm> pdm_;  // of the last model's options
  NoiseFilter noise_filter_;
  Planes alpha_, denoised_;
};

}  // namespace litags

#endif  // LITAGS_ENGINE_TRAIN_MODEL_H_
