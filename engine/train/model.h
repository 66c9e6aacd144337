// A trained scene and how to render it.
#ifndef LITAGS_ENGINE_TRAIN_MODEL_H_
#define LITAGS_ENGINE_TRAIN_MODEL_H_

#include <optional>

#include "engine/core/camera.h"
#include "engine/core/image.h"
#include "engine/core/splats.h"
#include "engine/denoise/pdm.h"
#include "engine/render/renderer.h"

namespace litags {

struct Model {
  Splats splats;
  bool lita = true;  // has the LITA attributes; else plain 3DGS
  bool use_pdm = true;
  PdmOptions pdm_options;
  PdmWeights pdm;
  int sh_degree = 3;  // in use
  int iteration = 0;
};

struct ModelView {
  Planes channels;  // [11, H, W], see RenderChannel; [3, H, W] for plain 3DGS
  Planes alpha;     // [1, H, W]
  Planes color;     // [3, H, W]: R, after denoising; not clamped
};

// Renders views of a model, keeping buffers between calls. Not thread-safe.
class ModelRenderer {
 public:
  explicit ModelRenderer(int threads) : threads_(threads) {}

  // The depth channel holds `depth_source`.
  void Render(const Model& model, const Camera& camera, DepthSource depth_source, ModelView* out);

 private:
  int threads_;
  Renderer renderer_;
  std::optional<Pdm> pdm_;  // of the last model's options
  Planes noise_;
};

// Planes [first, first + 3) as an image of their own.
void CopyPlanes(const Planes& from, int first, Planes* to);

}  // namespace litags

#endif  // LITAGS_ENGINE_TRAIN_MODEL_H_
