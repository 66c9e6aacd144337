// Tile-based Gaussian splatting on the CPU, forward and backward.
#ifndef LITAGS_ENGINE_RENDER_RENDERER_H_
#define LITAGS_ENGINE_RENDER_RENDERER_H_

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "absl/functional/function_ref.h"
#include "engine/core/camera.h"
#include "engine/core/cancel.h"
#include "engine/core/image.h"
#include "engine/core/splats.h"
#include "engine/render/dropout.h"

namespace litags {

// Order of the composited channels of a whole render.
enum RenderChannel : int {
  kChannelColor = 0,         // 3: R0
  kChannelDepth = 3,         // 1: D_r
  kChannelStructure = 4,     // 1: P_r
  kChannelIllumination = 5,  // 3: L_r
  kChannelNoise = 8,         // 3: N_GS, which only the denoiser reads
  kNumChannels = 11,
};

// Renders that hold less cost less. The first channels of a whole render, forward and backward:
constexpr int kColorOnly = 3;
constexpr int kWithoutNoise = 8;
// Forward only, for pictures:
constexpr int kDepthOnly = 1;      // where surfaces are, see Forward
constexpr int kColorAndNoise = 6;  // R0, N_GS: what the denoiser reads

// What the depth channel composites.
enum class DepthSource {
  kCameraZ,    // distance along the optical axis: what a user calls depth
  kAttribute,  // the learned attribute d_i: the paper's D_r
};

// How Gaussians about as small as a pixel are drawn. Both add eps to the diagonal of the 2D
// covariance Cov.
enum class PixelFilter {
  kDilate,  // 3DGS: and no more, so that they grow, by more of their size in smaller pictures
  kMip,     // opacity times sqrt(|Cov| / |Cov + eps I|), so that they cover as much as before: the
            // scene is as dense in pictures of any size (2D Mip filter; arXiv 2311.16493)
};

// A lamp that the camera carries lights what is near more: a Gaussian at the distance r from the
// camera has its colour times (distance / r)^power.
struct Lamp {
  float power = 0;     // 0: there is none
  float distance = 1;  // scene units, > 0
};

struct RenderSettings {
  int num_channels = kNumChannels;  // or one of the constants above
  int sh_degree = kMaxShDegree;     // 0..3
  DepthSource depth_source = DepthSource::kAttribute;
  std::array<float, kNumChannels> background = {};
  PixelRect crop;  // the part of the camera's image to draw, inside it; empty: all
  PixelFilter pixel_filter = PixelFilter::kDilate;  // as the scene was trained with
  float near_plane = 0.2f;              // scene units; Gaussians at or before it are dropped (3DGS)
  int threads = 0;                      // <= 0: all cores
  const CancelToken* cancel = nullptr;  // once raised, Forward leaves the picture unfinished
  // For pictures alone; no Backward follows these two:
  size_t max_pairs = 0;  // draws parts of about as many (Gaussian, tile) pairs, one after the
                         // other; 0: all at once, which takes 44 bytes a pair
  uint32_t kept_channels = ~uint32_t{0};  // bit c: the image has channel c, and no others
  Dropout dropout;                        // of training
  Lamp lamp;                              // that a photo was taken by
  bool pose_grad = false;                 // whether Backward fills pose_grad()
  // Bit c: Backward gives channel c's gradient to the Gaussians' values in it and to nothing else,
  // as if what they cover were given.
  uint32_t detached_channels = 0;
};

// A change of a camera's pose, in its own axes: the first three turn it, the others shift it,
// x_cam' = exp([w]) x_cam + v; radians and scene units. And the gradient with respect to one.
using PoseVector = std::array<double, 6>;

// Per-Gaussian statistics of one view that density control uses; index = Gaussian. Only entries
// of visible Gaussians are meaningful.
struct ViewStats {
  std::vector<uint8_t> visible;     // whether it reaches a pixel's alpha threshold: 0 or 1
  std::vector<float> grad_means2d;  // |dL/dmeans2d|, loss per px
};

// Receives the gradient of one block of 16 Gaussians, rows as in SplatRow, [kSplatRows][16]. Rows
// past SplatRowsForDegree(sh_degree) and lanes of Gaussians that are not visible are zero.
// `visible` has bit i set for lane i. Called once per block that has a visible Gaussian, from
// several threads.
using BlockGradSink = absl::FunctionRef<void(size_t block, const float* grads, uint32_t visible)>;

// Renders one view at a time and keeps what the backward pass needs. Results are the same bytes
// for any number of threads. Not thread-safe; use one per thread of control.
class Renderer {
 public:
  Renderer();
  ~Renderer();
  Renderer(Renderer&&) noexcept;
  Renderer& operator=(Renderer&&) noexcept;

  // LITA-GS Eq. 8, for every channel: R0, D_r, P_r, L_r, N_GS.
  // Composites `splats` into image [num_channels, H, W] (or those kept) and alpha [1, H, W] =
  // 1 - T_final, with H and W of the crop. The same bytes whatever is kept and in any parts.
  // Front to back by depth, alpha = min(0.99, o exp(-sigma)), skipped below 1/255, stopped before T
  // falls below 1e-4 (3DGS). No 3-sigma cut-off: extents are exact. The camera must be valid.
  // With kDepthOnly the image is a distance along the optical axis, without background: the mean
  // over the Gaussians that take T from kSurfaceFrom to kSurfaceTo, by how much of that each takes.
  // Neither a haze in front nor what shows through thin places moves it. A Gaussian is where the
  // ray meets it most: its mean Z given the pixel, to first order as its conic is, and not more
  // than kSurfaceTilt from its own. Where T stays above: the mean of all that is there; 0 where
  // alpha is below 1e-3.
  void Forward(const Splats& splats, const Camera& camera, const RenderSettings& settings,
               Planes* image, Planes* alpha);

  // VJP of the last Forward, of 3, 8 or 11 channels, all kept, and all at once: v_image [C, H, W],
  // v_alpha [1, H, W] (or empty) to the parameters. `splats` must be unchanged. Exact derivatives,
  // but for detached_channels: zero through the clamp at 0.99.
  void Backward(const Splats& splats, const Planes& v_image, const Planes& v_alpha,
                BlockGradSink sink);

  // Statistics of the last Forward (visible) and Backward (gradients).
  const ViewStats& stats() const;

  // Of the last Backward, if asked for: dL/d(w, v) at the camera's pose.
  const PoseVector& pose_grad() const;

  // Intermediates of the last Forward, for tests and benchmarks.
  struct Counters {
    int64_t visible = 0;      // Gaussians that reach a pixel's alpha threshold, in any part
    int64_t tile_pairs = 0;   // entries of the tile lists
    int64_t most_pairs = 0;   // of one part
    int64_t evaluations = 0;  // alpha evaluations, pixels (lanes counted one by one)
  };
  Counters counters() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace litags

#endif  // LITAGS_ENGINE_RENDER_RENDERER_H_
