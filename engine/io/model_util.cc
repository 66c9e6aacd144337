#include "engine/io/model_util.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/core.hpp>
#include <string>
#include <utility>

#include "engine/io/file_util.h"
#include "engine/io/io_error.h"

namespace litags {

absl::StatusOr<SparseModel> FinishModel(std::vector<LoadedView> views, std::string_view field,
                                        std::vector<size_t>* order, PanoramaNames* panoramas) {
  std::sort(views.begin(), views.end(),
            [](const LoadedView& a, const LoadedView& b) { return a.view.name < b.view.name; });
  SparseModel model;
  for (LoadedView& loaded : views) {
    const std::string& name = loaded.view.name;
    LITAGS_RETURN_IF_ERROR(ValidateFileName(name, field));
    const std::string where = absl::StrCat(Absl(field), "[", name, "]");
    LITAGS_RETURN_IF_ERROR(loaded.view.camera.Validate(where));
    const Distortion& d = loaded.distortion;
    if (!d.IsFinite()) {
      return InvalidField("NOT_FINITE", where,
                          "a lens distortion coefficient is NaN or infinite; send finite numbers");
    }
    if (!model.views.empty() && model.views.back().name == name) {
      return InvalidField("DUPLICATE_NAME", where,
                          "two cameras have this file name; give every photo its own");
    }
    if (loaded.panorama && panoramas == nullptr) {
      return InvalidField("UNSUPPORTED_CAMERA_MODEL", where,
                          "panoramas (EQUIRECTANGULAR, spherical) are not supported here; "
                          "cut views out of them first");
    }
    if (loaded.panorama) panoramas->insert(name);
    if (order != nullptr) order->push_back(loaded.source_id);
    model.distortions.push_back(d);
    model.views.push_back(std::move(loaded.view));
  }
  return model;
}

absl::Status SetSize(double width, double height, std::string_view where, Camera* camera) {
  constexpr double kMaxSide = 1 << 24;
  for (const double side : {width, height}) {
    if (!(side >= 1 && side <= kMaxSide) || side != std::floor(side)) {
      return InvalidField("BAD_CAMERA_SIZE", where,
                          absl::StrCat("a side of ", side, " is not a number of pixels"));
    }
  }
  camera->width = static_cast<int>(width);
  camera->height = static_cast<int>(height);
  return absl::OkStatus();
}

void SetPanorama(Camera* camera) {
  camera->fx = camera->fy = camera->width / (2 * std::numbers::pi);
  camera->cx = camera->width / 2.0;
  camera->cy = camera->height / 2.0;
}

absl::Status SetPlace(std::span<const double, 9> rotation, std::span<const double, 3> center,
                      std::string_view where, Camera* camera) {
  constexpr double kTolerance = 1e-3;
  const cv::Matx33d given(rotation.data());
  cv::Matx33d u, vt;
  cv::Vec3d singular;
  cv::SVD::compute(given, singular, u, vt);
  const cv::Matx33d nearest = u * vt;
  if (!(cv::norm(given - nearest) < kTolerance) || cv::determinant(nearest) < 0) {
    return InvalidField("NOT_A_ROTATION", where, "its rotation mirrors, shears or scales");
  }
  const cv::Vec3d t = nearest * -cv::Vec3d(center.data());
  for (int i = 0; i < 9; ++i) camera->R[i] = nearest.val[i];
  for (int i = 0; i < 3; ++i) camera->t[i] = t[i];
  return absl::OkStatus();
}

}  // namespace litags
