// Gaussians to screen space and back (EWA splatting; Zwicker et al. 2001, 3DGS Sec. 4).
#ifndef LITAGS_ENGINE_RENDER_PROJECTION_H_
#define LITAGS_ENGINE_RENDER_PROJECTION_H_

#include <cstddef>
#include <cstdint>
#include <vector>

#include "engine/core/camera.h"
#include "engine/core/splats.h"
#include "engine/render/renderer.h"

namespace litags {

// A camera in the kernels' precision, with the limits on X/Z and Y/Z worked out.
struct KernelCamera {
  KernelCamera() = default;
  explicit KernelCamera(const Camera& camera);

  // Sees these pixels of its image. Limits stay those of the whole, so that the pixels do.
  void CropTo(const PixelRect& crop);

  float width = 0, height = 0, fx = 0, fy = 0, cx = 0, cy = 0;
  float R[9] = {}, t[3] = {}, center[3] = {};
  float min_u = 0, max_u = 0, min_v = 0, max_v = 0;
  float spread_x = 0, spread_y = 0;  // px Z per unit of a Gaussian's scale, at most
};

// One Gaussian as the rasteriser reads it: kRecordFeatures numbers, then the channels.
//   log2 alpha(dx, dy) = log2_opacity + a dx^2 + b dx dy + c dy^2,  d = pixel centre - mean2d
// The region where alpha >= 1/255 is an ellipse around mean2d: for |dy| <= half_height,
// dx = shear dy +- aspect sqrt(half_height^2 - dy^2); its rightmost point is at dy = dy_right.
constexpr int kRecordX = 0;  // the first six are the ellipse
constexpr int kRecordY = 1;
constexpr int kRecordHalfHeight = 2;
constexpr int kRecordShear = 3;
constexpr int kRecordAspect = 4;
constexpr int kRecordDyRight = 5;
constexpr int kRecordA = 6;
constexpr int kRecordB = 7;
constexpr int kRecordC = 8;
constexpr int kRecordLog2Opacity = 9;
constexpr int kRecordFeatures = 10;
// Of kDepthOnly, whose channel is Z of the mean: where a ray meets the Gaussian most, to first
// order Z + dz_dx dx + dz_dy dy.
constexpr int kRecordDzDx = kRecordFeatures + 1;
constexpr int kRecordDzDy = kRecordFeatures + 2;
constexpr int RecordStride(int channels) { return (kRecordFeatures + channels + 7) / 8 * 8; }

// What is summed over pixels for one Gaussian in the backward pass: with g = dL/d(ln alpha),
// moments of g over d, two unused places that fill the vector up, then dL/dchannel.
constexpr int kGradSum = 0;  // sum g
constexpr int kGradX = 1;    // sum g dx
constexpr int kGradY = 2;    // sum g dy
constexpr int kGradXX = 3;
constexpr int kGradXY = 4;
constexpr int kGradYY = 5;
constexpr int kGradFeatures = 8;
constexpr int GradStride(int channels) { return (kGradFeatures + channels + 7) / 8 * 8; }

// Screen-space Gaussians of one view; index = Gaussian. Entries of Gaussians that are not visible
// (x0 > x1) are stale.
struct ProjectedSplats {
  void Resize(size_t n, int channels);

  int channels = 0;
  AlignedFloats records;      // [N][RecordStride]
  std::vector<float> depths;  // [N], scene units
  struct Box {
    int16_t x0 = 0, x1 = -1, y0 = 0, y1 = -1;  // px, inclusive, inside the image
    bool empty() const { return x0 > x1; }
  };
  std::vector<Box> boxes;
  // Tile columns that the ellipse reaches in the first rows of tiles of its box, 0 and -1 where
  // there are none. Hardly any Gaussian has more rows.
  static constexpr int kSpanRows = 2;
  struct Spans {
    int16_t first[kSpanRows], last[kSpanRows];
  };
  std::vector<Spans> spans;
  std::vector<uint8_t> visible;  // [blocks], how many of a block's Gaussians
};

// LITA-GS Eq. 8: mu' and Sigma2D.
// Projects block `block` of 16 Gaussians. Thread-safe for different blocks.
void ProjectBlock(const Splats& splats, size_t block, const KernelCamera& camera,
                  const RenderSettings& settings, ProjectedSplats* out);

// VJP of ProjectBlock. `sums` [GradStride][16] are the pixel sums per Gaussian, zero for lanes not
// in `visible`; writes grads [kSplatRows][16] (rows past the SH degree are left alone),
// mean2d_grad [2][16], loss per px, and, unless it is null, the block's part of
// Renderer::pose_grad().
void ProjectBlockVjp(const Splats& splats, size_t block, const KernelCamera& camera,
                     const RenderSettings& settings, const float* sums, uint32_t visible,
                     float* grads, float* mean2d_grad, PoseVector* pose_grad);

}  // namespace litags

#endif  // LITAGS_ENGINE_RENDER_PROJECTION_H_
