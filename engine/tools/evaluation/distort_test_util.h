// For tests: what a lens with distortion makes of a pinhole picture.
#ifndef LITAGS_ENGINE_TOOLS_EVALUATION_DISTORT_TEST_UTIL_H_
#define LITAGS_ENGINE_TOOLS_EVALUATION_DISTORT_TEST_UTIL_H_

#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "engine/core/camera.h"
#include "engine/core/image.h"
#include "engine/io/sparse_model.h"

namespace litags {

// The photo as taken; Undistort takes it back, up to interpolation.
inline ImageU8 DistortPicture(ImageU8 picture, const Camera& c, const Distortion& d) {
  std::vector<cv::Point2f> seen, source;
  for (int y = 0; y < picture.height; ++y) {
    for (int x = 0; x < picture.width; ++x) seen.emplace_back(x, y);
  }
  // Pixel centres are at .5 with us, at whole numbers with OpenCV.
  const cv::Matx33d K(c.fx, 0, c.cx - 0.5, 0, c.fy, c.cy - 0.5, 0, 0, 1);
  cv::undistortPoints(seen, source, K, cv::Vec4d(d.k1, d.k2, d.p1, d.p2), cv::noArray(), K);
  ImageU8 out(picture.width, picture.height);
  const cv::Mat from(picture.height, picture.width, CV_8UC3, picture.data.data());
  cv::Mat to(out.height, out.width, CV_8UC3, out.data.data());
  cv::remap(from, to, cv::Mat(source).reshape(2, picture.height), cv::noArray(), cv::INTER_CUBIC,
            cv::BORDER_REPLICATE);
  return out;
}

}  // namespace litags

#endif  // LITAGS_ENGINE_TOOLS_EVALUATION_DISTORT_TEST_UTIL_H_
