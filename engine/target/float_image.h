// Photos as OpenCV matrices; for the sources of this folder only.
#ifndef LITAGS_ENGINE_TARGET_FLOAT_IMAGE_H_
#define LITAGS_ENGINE_TARGET_FLOAT_IMAGE_H_

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "engine/core/photo.h"

namespace litags {

using FloatImage = cv::Mat_<cv::Vec3f>;
using FloatPlane = cv::Mat_<float>;

// From 0 at x <= 0 to 1 at x >= 1 without a kink.
inline float SmoothStep(float x) {
  x = std::clamp(x, 0.0f, 1.0f);
  return x * x * (3 - 2 * x);
}

inline cv::Mat Blur(const cv::Mat& image, double sigma) {
  cv::Mat out;
  cv::GaussianBlur(image, out, cv::Size(), sigma, sigma, cv::BORDER_REPLICATE);
  return out;
}

// The photo's codes in [0, 1], smoothed: noise and compression scatter clipped samples below 255.
inline FloatImage SmoothCodes(const Photo& photo) {
  constexpr double kSigma = 0.0015;  // of the photo's longer side
  const cv::Mat codes(photo.height, photo.width, CV_16SC3, const_cast<int16_t*>(photo.data.data()));
  FloatImage scaled;
  codes.convertTo(scaled, CV_32FC3, 1.0 / kPhotoWhite);
  return Blur(scaled, std::max(0.5, kSigma * std::max(photo.width, photo.height)));
}

// Linear light, 1: the photo's white.
inline FloatImage LinearImage(const Photo& photo) {
  FloatImage linear(photo.height, photo.width);
  for (size_t i = 0; i < photo.pixels(); ++i) {
    for (int c = 0; c < 3; ++c) linear(int(i))[c] = LinearTable::Get()(photo.data[3 * i + c]);
  }
  return linear;
}

}  // namespace litags

#endif  // LITAGS_ENGINE_TARGET_FLOAT_IMAGE_H_
