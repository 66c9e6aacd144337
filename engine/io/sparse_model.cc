#include "engine/io/sparse_model.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "absl/functional/function_ref.h"
#include "engine/core/check.h"
#include "engine/core/mask.h"
#include "engine/core/photo.h"
#include "engine/io/io_error.h"

namespace litags {
namespace {

// Steps at which a lens's curve is looked at.
constexpr int kCurveSteps = 64;

// Of FisheyeRadius: whether it still rises at an angle.
bool Rises(const Distortion& d, double angle) {
  const double t2 = angle * angle;
  return 1 + t2 * (3 * d.k1 + t2 * (5 * d.k2 + t2 * (7 * d.k3 + t2 * 9 * d.k4))) > 0;
}

// Whether the lens puts what lies a little farther than `r` from the middle farther out, too.
bool RisesAt(const Distortion& d, double r) {
  if (d.fisheye) return Rises(d, std::atan(r));
  const double r2 = r * r;
  const double above = 1 + r2 * (d.k1 + r2 * (d.k2 + r2 * d.k3));
  const double below = 1 + r2 * (d.k4 + r2 * (d.k5 + r2 * d.k6));
  const double above_slope = d.k1 + r2 * (2 * d.k2 + r2 * 3 * d.k3);  // by r^2
  const double below_slope = d.k4 + r2 * (2 * d.k5 + r2 * 3 * d.k6);
  // Of r above / below, times below^2. Behind a pole the curve comes from the other side.
  return below > 0 && above * below + 2 * r2 * (above_slope * below - above * below_slope) > 0;
}

// Between `low`, for which `is_below` holds, and `high`: where it stops.
double Bisect(double low, double high, absl::FunctionRef<bool(double)> is_below) {
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    (is_below(middle) ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

// How far from the middle the lens's curve rises; infinite if beyond `most`. Behind that it folds
// back, and would show again what lies before it.
double FoldRadius(const Distortion& d, double most) {
  for (int i = 1; i <= kCurveSteps; ++i) {
    const double r = most * i / kCurveSteps;
    if (RisesAt(d, r)) continue;
    return Bisect(most * (i - 1) / kCurveSteps, r, [&](double at) { return RisesAt(d, at); });
  }
  return std::numeric_limits<double>::infinity();
}

// How far from the middle the picture's farthest corner is, for focal length 1.
double CornerRadius(const Camera& c) {
  return std::hypot(std::max(c.cx, c.width - c.cx) / c.fx, std::max(c.cy, c.height - c.cy) / c.fy);
}

// `out` of type and size of `in`: what the pinhole `camera` would have taken. What the lens does
// not show is taken from beyond the photo's border.
absl::Status Remap(const cv::Mat& in, const Camera& camera, const Distortion& lens,
                   int interpolation, int border, cv::Mat* out) {
  if (!lens.IsFinite()) {
    return InvalidField("NOT_FINITE", "distortion",
                        "a lens distortion coefficient is NaN or infinite; send finite numbers");
  }
  try {
    // OpenCV counts pixels from their centres, we from their corners.
    cv::Mat map_x(in.size(), CV_32FC1), map_y(in.size(), CV_32FC1);
    const double fold = FoldRadius(lens, CornerRadius(camera));
    const double outside = 2.0 * (in.cols + in.rows);  // px from the middle
    for (int v = 0; v < in.rows; ++v) {
      float* const to_x = map_x.ptr<float>(v);
      float* const to_y = map_y.ptr<float>(v);
      const double y = (v + 0.5 - camera.cy) / camera.fy;
      for (int u = 0; u < in.cols; ++u) {
        const double x = (u + 0.5 - camera.cx) / camera.fx, r = std::sqrt(x * x + y * y);
        const auto seen =
            r < fold ? Distort(lens, x, y)
                     : std::array{x / r * outside / camera.fx, y / r * outside / camera.fy};
        to_x[u] = static_cast<float>(camera.fx * seen[0] + camera.cx - 0.5);
        to_y[u] = static_cast<float>(camera.fy * seen[1] + camera.cy - 0.5);
      }
    }
    cv::remap(in, *out, map_x, map_y, interpolation, border);
    return absl::OkStatus();
  } catch (const cv::Exception& e) {
    return FieldError(absl::StatusCode::kInternal, "UNDISTORT_FAILED", "image", e.what());
  }
}

}  // namespace

bool Distortion::IsFinite() const {
  const auto all = Coefficients();
  return std::all_of(all.begin(), all.end(), [](double k) { return std::isfinite(k); });
}

absl::Status CheckIntrinsics(const Camera& c, std::string_view where) {
  constexpr double kLeastFocal = 0.05;  // of the longer side: a field of view of 168 degrees
  const auto bad = [&](std::string_view reason, std::string_view what) {
    return InvalidField(reason, where,
                        absl::StrCat(Absl(what), " a picture of ", c.width, "x", c.height,
                                     " px; give size, focal lengths and principal point in px, of "
                                     "photos of one size"));
  };
  if (!(c.cx >= 0 && c.cx <= c.width && c.cy >= 0 && c.cy <= c.height)) {
    return bad("BAD_PRINCIPAL_POINT", absl::StrCat("the principal point, cx ", c.cx, " and cy ",
                                                   c.cy, " px, lies outside"));
  }
  const double least = kLeastFocal * std::max(c.width, c.height);
  if (c.fx >= least && c.fy >= least) return absl::OkStatus();
  return bad("BAD_FOCAL_LENGTH", absl::StrCat("the focal lengths, ", c.fx, " and ", c.fy,
                                              " px, are those of no lens for"));
}

double FisheyeRadius(const Distortion& d, double angle) {
  const double t2 = angle * angle;
  return angle * (1 + t2 * (d.k1 + t2 * (d.k2 + t2 * (d.k3 + t2 * d.k4))));
}

double FisheyeAngle(const Distortion& d, double radius, double most) {
  const auto rises = [&](double angle) { return Rises(d, angle); };
  const auto is_below = [&](double angle) { return FisheyeRadius(d, angle) < radius; };
  double low = 0, high = 0;
  for (int i = 1; i <= kCurveSteps; ++i) {
    low = high;
    high = most * i / kCurveSteps;
    if (!rises(high)) {
      high = Bisect(low, high, rises);
      break;
    }
    if (!is_below(high)) break;
  }
  return Bisect(low, high, is_below);
}

std::array<double, 2> Distort(const Distortion& d, double x, double y) {
  const double r2 = x * x + y * y;
  if (d.fisheye) {
    const double r = std::sqrt(r2);
    const double scale = r > 0 ? FisheyeRadius(d, std::atan(r)) / r : 1;
    return {x * scale, y * scale};
  }
  const double radial =
      (1 + r2 * (d.k1 + r2 * (d.k2 + r2 * d.k3))) / (1 + r2 * (d.k4 + r2 * (d.k5 + r2 * d.k6)));
  return {x * radial + 2 * d.p1 * x * y + d.p2 * (r2 + 2 * x * x),
          y * radial + d.p1 * (r2 + 2 * y * y) + 2 * d.p2 * x * y};
}

std::optional<std::array<double, 2>> Undistort(const Distortion& d, double x, double y) {
  double px = x, py = y;
  if (d.fisheye) {
    constexpr double kMost = 0.499 * std::numbers::pi;
    const double seen = std::hypot(x, y);
    const double scale = seen > 0 ? std::tan(FisheyeAngle(d, seen, kMost)) / seen : 1;
    px *= scale;
    py *= scale;
  } else {
    // The way of OpenCV and COLMAP, a fixed point: distortions of photos are small. Few steps do
    // but near to where the curve folds back.
    constexpr int kSteps = 200;
    for (int i = 0; i < kSteps; ++i) {
      const auto seen = Distort(d, px, py);
      const double dx = x - seen[0], dy = y - seen[1];
      px += dx;
      py += dy;
      if (dx * dx + dy * dy < 1e-20) break;
    }
  }
  constexpr double kNear = 1e-6;  // some thousandths of a pixel
  const auto seen = Distort(d, px, py);
  const double r = std::hypot(px, py);
  if (!(std::hypot(seen[0] - x, seen[1] - y) < kNear) || FoldRadius(d, r) <= r) return std::nullopt;
  return std::array{px, py};
}

double LargestShift(const Camera& camera, const Distortion& d) {
  constexpr int kSteps = 16;  // a side
  double largest = 0;
  for (int i = 0; i <= kSteps; ++i) {
    for (int j = 0; j <= kSteps; ++j) {
      const double x = (double(camera.width) * j / kSteps - camera.cx) / camera.fx;
      const double y = (double(camera.height) * i / kSteps - camera.cy) / camera.fy;
      const auto seen = Distort(d, x, y);
      largest = std::max(largest, std::hypot(camera.fx * (seen[0] - x), camera.fy * (seen[1] - y)));
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

absl::StatusOr<PlaneU8> MaskOfUndistorted(const Camera& camera, const Distortion& distortion) {
  if (distortion.IsZero()) return PlaneU8();
  const cv::Mat photo(camera.height, camera.width, CV_8U, cv::Scalar(kCounts));
  PlaneU8 mask(camera.width, camera.height);
  cv::Mat result(mask.height, mask.width, CV_8U, mask.data.data());
  // A place less than half a pixel beyond the outer pixels' centres is on these pixels.
  LITAGS_RETURN_IF_ERROR(
      Remap(photo, camera, distortion, cv::INTER_NEAREST, cv::BORDER_CONSTANT, &result));
  if (CountedPixels(mask, mask.data.size()) == mask.data.size()) return PlaneU8();
  return mask;
}

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
