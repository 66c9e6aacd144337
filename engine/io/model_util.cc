#include "engine/io/model_util.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <numeric>
#include <opencv2/core.hpp>
#include <string>
#include <utility>

#include "engine/io/file_util.h"
#include "engine/io/io_error.h"

namespace litags {

namespace {

// Names of the photos at `paths` if they lay in one folder: those that several have get the folders
// in which they differ.
std::vector<std::string> NamesOf(const std::vector<LoadedView>& views) {
  std::vector<std::string> names;
  std::map<std::string, int> count;
  for (const LoadedView& loaded : views) {
    names.push_back(BaseName(loaded.view.name));
    ++count[names.back()];
  }
  std::vector<size_t> twice;
  for (size_t i = 0; i < views.size(); ++i) {
    if (count[names[i]] > 1) twice.push_back(i);
  }
  if (twice.empty()) return names;
  const std::string& first = views[twice[0]].view.name;
  size_t common = first.size();
  for (const size_t i : twice) {
    const std::string& path = views[i].view.name;
    const auto end = first.begin() + static_cast<ptrdiff_t>(std::min(common, path.size()));
    common =
        static_cast<size_t>(std::mismatch(first.begin(), end, path.begin()).first - first.begin());
  }
  const size_t slash = first.substr(0, common).find_last_of("/\\");
  const size_t start = slash == std::string::npos ? 0 : slash + 1;
  for (const size_t i : twice) {
    names[i] = NamesInOneFolder(std::string_view(views[i].view.name).substr(start)).front();
  }
  return names;
}

// Of any size: that of the photos, to which cameras are brought, is checked with the photos.
absl::Status Validate(Camera camera, std::string_view where) {
  camera.width = std::min(camera.width, kMaxImageSide);
  camera.height = std::min(camera.height, kMaxImageSide);
  return camera.Validate(where, std::numeric_limits<int64_t>::max());
}

}  // namespace

absl::StatusOr<SparseModel> FinishModel(std::vector<LoadedView> views, std::string_view field,
                                        std::vector<size_t>* order, PanoramaNames* panoramas) {
  SparseModel model;
  const std::vector<std::string> names = NamesOf(views);
  std::vector<size_t> by_name(views.size());
  std::iota(by_name.begin(), by_name.end(), size_t{0});
  std::stable_sort(by_name.begin(), by_name.end(),
                   [&](size_t a, size_t b) { return names[a] < names[b]; });
  for (const size_t i : by_name) {
    LoadedView& loaded = views[i];
    const std::string& name = names[i];
    LITAGS_RETURN_IF_ERROR(ValidateFileName(name, field));
    const std::string where = absl::StrCat(Absl(field), "[", name, "]");
    LITAGS_RETURN_IF_ERROR(Validate(loaded.view.camera, where));
    if (loaded.has_size && !loaded.panorama) {
      LITAGS_RETURN_IF_ERROR(CheckIntrinsics(loaded.view.camera, where));
    }
    const Distortion& d = loaded.distortion;
    if (!d.IsFinite()) {
      return InvalidField("NOT_FINITE", where,
                          "a lens distortion coefficient is NaN or infinite; send finite numbers");
    }
    if (!model.views.empty() && model.views.back().name == name) {
      return InvalidField(
          "DUPLICATE_NAME", where,
          "two cameras are of this photo; give every photo its own camera and name");
    }
    if (loaded.panorama && panoramas == nullptr) {
      return InvalidField("UNSUPPORTED_CAMERA_MODEL", where,
                          "panoramas (EQUIRECTANGULAR, spherical) are not supported here; "
                          "cut views out of them first");
    }
    if (loaded.panorama) panoramas->insert(name);
    if (order != nullptr) order->push_back(loaded.source_id);
    model.distortions.push_back(d);
    model.paths.push_back(std::move(loaded.view.name));
    model.views.push_back({name, loaded.view.camera});
  }
  return model;
}

absl::Status SetSize(double width, double height, std::string_view where, Camera* camera) {
  for (const double side : {width, height}) {
    if (!(side >= 1 && side <= kMaxCameraSide) || side != std::floor(side)) {
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
