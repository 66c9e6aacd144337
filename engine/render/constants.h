#ifndef LITAGS_ENGINE_RENDER_CONSTANTS_H_
#define LITAGS_ENGINE_RENDER_CONSTANTS_H_

namespace litags {

// Thresholds of 3DGS' compositing (Kerbl et al. 2023, Sec. 4 and its appendix). The reference
// cases and every published model assume them.
constexpr float kAlphaMax = 0.99f;             // keeps 1 - alpha away from 0 for the gradients
constexpr float kAlphaMin = 1.0f / 255.0f;     // below one 8-bit step a Gaussian is invisible
constexpr float kLog2AlphaMin = -7.99435344f;  // its base-2 logarithm, which kernels compare with
constexpr float kTransmittanceStop = 1e-4f;    // nothing behind can change an 8-bit pixel
constexpr float kEps2d = 0.3f;                 // px^2 added to the 2D covariance (low-pass)
constexpr float kMipEps2d = 0.1f;              // the same of PixelFilter::kMip (Mip-Splatting's)

// X/Z and Y/Z inside the projection's Jacobian are limited to the image plus this fraction of it on
// each side: the local affine approximation is meaningless far outside the view (3DGS, gsplat).
constexpr float kJacobianMargin = 0.15f;

constexpr int kTileSize = 16;   // px, a side
constexpr int kBlockWidth = 4;  // px; a SIMD vector covers 4 x (lanes / 4) pixels

// What hides the view between these transmittances is taken for the surface. Chosen on a capture
// with exact depth, docs/experiments/depth.md.
constexpr float kSurfaceFrom = 0.6f;
constexpr float kSurfaceTo = 0.3f;
constexpr float kSurfaceTilt = 0.1f;  // of its Z, how far from it a Gaussian may reach. As above

}  // namespace litags

#endif  // LITAGS_ENGINE_RENDER_CONSTANTS_H_
