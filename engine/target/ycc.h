// Luma and chroma by ITU-R BT.601.
#ifndef LITAGS_ENGINE_TARGET_YCC_H_
#define LITAGS_ENGINE_TARGET_YCC_H_

#include <opencv2/core.hpp>

#include "engine/core/color.h"

namespace litags {

// Cb = (B - Y) / kBlueOfCb, Cr = (R - Y) / kRedOfCr.
inline constexpr double kBlueOfCb = 1.772, kRedOfCr = 1.402;

inline float Luma(const cv::Vec3f& rgb) { return Luma(rgb[0], rgb[1], rgb[2]); }

// Y, Cb and Cr.
inline cv::Vec3f YccOfRgb(const cv::Vec3f& rgb) {
  const float y = Luma(rgb);
  return {y, (rgb[2] - y) / float{kBlueOfCb}, (rgb[0] - y) / float{kRedOfCr}};
}

inline cv::Vec3f RgbOfYcc(const cv::Vec3f& ycc) {
  return {ycc[0] + float{kRedOfCr} * ycc[2], ycc[0] - 0.344136f * ycc[1] - 0.714136f * ycc[2],
          ycc[0] + float{kBlueOfCb} * ycc[1]};
}

}  // namespace litags

#endif  // LITAGS_ENGINE_TARGET_YCC_H_
