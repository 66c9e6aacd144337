#include "engine/io/sparse_model.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "engine/core/check.h"
#include "engine/io/colmap_io.h"
#include "engine/io/io_error.h"
#include "engine/io/transforms_io.h"

namespace litags {
namespace {

// `out` of type and size of `in`: what the pinhole `camera` would have taken.
absl::Status Remap(const cv::Mat& in, const Camera& camera, const Distortion& distortion,
                   int interpolation, int border, cv::Mat* out) {
  const double coefficients[4] = {distortion.k1, distortion.k2, distortion.p1, distortion.p2};
  for (double k : coefficients) {
    if (!std::isfinite(k)) {
      return InvalidField("NOT_FINITE", "distortion",
                          "a lens distortion coefficient is NaN or infinite; send finite numbers");
    }
  }
  try {
    // OpenCV counts pixels from their centres, we from their corners.
    const cv::Matx33d K(camera.fx, 0, camera.cx - 0.5, 0, camera.fy, camera.cy - 0.5, 0, 0, 1);
    cv::Mat map_x, map_y;
    cv::initUndistortRectifyMap(K, cv::Mat(1, 4, CV_64F, const_cast<double*>(coefficients)),
                                cv::noArray(), K, in.size(), CV_32FC1, map_x, map_y);
    cv::remap(in, *out, map_x, map_y, interpolation, border);
    return absl::OkStatus();
  } catch (const cv::Exception& e) {
    return FieldError(absl::StatusCode::kInternal, "UNDISTORT_FAILED", "image", e.what());
  }
}

}  // namespace

absl::StatusOr<SparseModel> ReadCameras(const std::string& path, std::string_view field,
                                        int default_width, int default_height) {
  std::error_code error;
  if (std::filesystem::is_directory(path, error)) return ReadColmapModel(path, field);
  return ReadTransforms(path, field, default_width, default_height);
}

double LargestShift(const Camera& camera, const Distortion& d) {
  constexpr int kSteps = 16;  // a side
  double largest = 0;
  for (int i = 0; i <= kSteps; ++i) {
    for (int j = 0; j <= kSteps; ++j) {
      const double x = (double(camera.width) * j / kSteps - camera.cx) / camera.fx;
      const double y = (double(camera.height) * i / kSteps - camera.cy) / camera.fy;
      const double r2 = x * x + y * y, radial = r2 * (d.k1 + r2 * d.k2);
      const double dx = x * radial + 2 * d.p1 * x * y + d.p2 * (r2 + 2 * x * x);
      const double dy = y * radial + d.p1 * (r2 + 2 * y * y) + 2 * d.p2 * x * y;
      largest =
          std::max(largest, std::sqrt(std::pow(camera.fx * dx, 2) + std::pow(camera.fy * dy, 2)));
    }
  }
  return largest;
}

template <typename T>
absl::StatusOr<Image<T>> Undistort(const Image<T>& image, const Camera& camera,
                                   const Distortion& distortion) {
  if (image.empty() || image.width != camera.width || image.height != camera.height) {
    return InvalidField("SIZE_MISMATCH", "image",
                        absl::StrCat("the photo has ", image.width, "x", image.height,
                                     " px, its camera ", camera.width, "x", camera.height,
                                     "; use the photos the cameras were made for"));
  }
  if (distortion.IsZero()) return image;
  const int type = CV_MAKETYPE(cv::DataType<T>::depth, 3);
  const cv::Mat in(image.height, image.width, type, const_cast<T*>(image.data.data()));
  Image<T> out(image.width, image.height);
  cv::Mat result(out.height, out.width, type, out.data.data());
  LITAGS_RETURN_IF_ERROR(
      Remap(in, camera, distortion, cv::INTER_LINEAR, cv::BORDER_REPLICATE, &result));
  return out;
}

template absl::StatusOr<ImageU8> Undistort(const ImageU8&, const Camera&, const Distortion&);
template absl::StatusOr<Photo> Undistort(const Photo&, const Camera&, const Distortion&);

absl::StatusOr<Planes> UndistortNearest(const Planes& plane, const Camera& camera,
                                        const Distortion& distortion) {
  LITAGS_CHECK(plane.channels == 1);
  if (distortion.IsZero()) return plane;
  const cv::Mat in(plane.height, plane.width, CV_32F, const_cast<float*>(plane.data.data()));
  Planes out(1, plane.height, plane.width);
  cv::Mat result(out.height, out.width, CV_32F, out.data.data());
  LITAGS_RETURN_IF_ERROR(Remap(in, camera.Scaled(plane.width, plane.height), distortion,
                               cv::INTER_NEAREST, cv::BORDER_CONSTANT, &result));
  return out;
}

}  // namespace litags
