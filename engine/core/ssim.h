// What SSIM is made of (Wang et al. 2004), for values in [0, 1]: one for losses and for tables.
#ifndef LITAGS_ENGINE_CORE_SSIM_H_
#define LITAGS_ENGINE_CORE_SSIM_H_

namespace litags {

inline constexpr int kSsimRadius = 5;  // of the window: 11x11 px
inline constexpr double kSsimSigma = 1.5;
// C1 = K1^2, C2 = K2^2.
inline constexpr double kSsimK1 = 0.01, kSsimK2 = 0.03;

}  // namespace litags

#endif  // LITAGS_ENGINE_CORE_SSIM_H_
