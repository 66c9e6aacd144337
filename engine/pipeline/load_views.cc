#include "engine/pipeline/load_views.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "engine/core/error.h"
#include "engine/core/limits.h"
#include "engine/core/mask.h"
#include "engine/core/parallel.h"
#include "engine/io/file_util.h"
#include "engine/io/image_io.h"
#include "engine/pipeline/capture_checks.h"
#include "engine/pipeline/shrink.h"
#include "engine/target/shadow_color.h"

namespace litags {
namespace {

constexpr size_t kPhotosOfColors = 8;  // that the capture's colours are measured on

std::string PathOf(const ReconstructInput& input, const std::string& name) {
  return absl::StrCat(input.images_dir, "/", name);
}

std::string MaskPathOf(const MaskPaths& masks, const std::string& name) {
  const auto mask = masks.find(name);
  return mask == masks.end() ? "" : mask->second;
}

// Of photos spread evenly over the capture, as the camera wrote them.
absl::StatusOr<ColorPrior> MeasureColors(const ReconstructInput& input, const SparseModel& model,
                                         const MaskPaths& masks, int threads,
                                         const CancelToken& cancel) {
  const size_t all = model.views.size(), n = std::min(all, kPhotosOfColors);
  std::vector<ColorPrior> priors(n);
  std::vector<absl::Status> status(n);
  ParallelFor(threads, n, [&](size_t i, int) {
    status[i] = [&]() -> absl::Status {
      LITAGS_RETURN_IF_ERROR(cancel.Check());
      const std::string& name = model.views[i * all / n].name;
      const std::string path = PathOf(input, name), field = absl::StrCat("images[", name, "]");
      LITAGS_ASSIGN_OR_RETURN(const ImageInfo info, ReadImageSize(path, field));
      LITAGS_ASSIGN_OR_RETURN(const MaskedPhoto read,
                              ReadMaskedPhoto(path, field, MaskPathOf(masks, name)));
      priors[i] = MeasureColorPrior(read.photo, info.chroma_step, read.mask);
      return absl::OkStatus();
    }();
  });
  for (const absl::Status& s : status) LITAGS_RETURN_IF_ERROR(s);
  return MedianPrior(priors);
}

// Photo and mask as their pinhole camera sees them.
absl::Status LoadPhoto(const std::string& path, const std::string& mask_path,
                       const Distortion& distortion, const ShadowColors* shadows, TrainView* v) {
  const std::string field = absl::StrCat("images[", v->view.name, "]");
  LITAGS_ASSIGN_OR_RETURN(MaskedPhoto read, ReadMaskedPhoto(path, field, mask_path));
  v->photo = std::move(read.photo);
  v->mask = std::move(read.mask);
  const Camera& camera = v->view.camera;
  if (v->photo.width != camera.width || v->photo.height != camera.height) {
    return InvalidInput(
        "CAMERA_SIZE_MISMATCH", field,
        absl::StrCat(v->view.name, ": the photo is ", v->photo.width, "x", v->photo.height,
                     " but its camera says ", camera.width, "x", camera.height,
                     "; send the photo as it was when its camera was found, or "
                     "delete the folder cameras of this run"));
  }
  if (shadows != nullptr) v->photo = shadows->Infer(v->photo, v->mask);
  v->distortion = distortion;
  if (distortion.IsZero()) return absl::OkStatus();
  absl::Status status;
  const auto undistort = [&]<class T>(const Image<T>& image) {
    absl::StatusOr<Image<T>> pinhole = Undistort(image, camera, distortion);
    status.Update(pinhole.status());
    return pinhole.ok() ? *std::move(pinhole) : Image<T>();
  };
  v->photo = undistort(v->photo);
  if (!v->mask.empty()) v->mask = ChangeMask(v->mask, undistort);
  return status;
}

// A mask may leave something of the photo as it was taken, and nothing at the size of training.
absl::Status CheckMask(const TrainView& v, const std::string& mask_path) {
  if (CountedPixels(v.mask, v.photo.data.size() / 3) > 0) return absl::OkStatus();
  const std::string field = absl::StrCat("masks[", BaseName(mask_path), "]");
  return InvalidInput("MASK_BLACK", field,
                      absl::StrCat(field, ": at ", v.mask.width, "x", v.mask.height,
                                   " px, the size of training, no pixel of the photo counts; "
                                   "leave the photo out"));
}

}  // namespace

absl::StatusOr<LoadedViews> LoadViews(const Context& context, const SparseModel& model,
                                      const MaskPaths& masks) {
  const ReconstructInput& input = context.input;
  const ReconstructOptions& options = context.options;
  ReconstructReport* const report = context.report;
  const size_t n = model.views.size();
  std::vector<TrainView> views(n);
  std::vector<absl::Status> status(n);
  std::vector<std::optional<std::array<uint8_t, 3>>> flat(n);
  std::optional<ShadowColors> shadows;
  if (context.recipe.tone.rule == Tone::kCapture) {
    LITAGS_ASSIGN_OR_RETURN(const ColorPrior colors,
                            MeasureColors(input, model, masks, options.threads, context.cancel));
    shadows.emplace(colors);
  }
  ParallelFor(options.threads, n, [&](size_t i, int) {
    status[i] = [&]() -> absl::Status {
      LITAGS_RETURN_IF_ERROR(context.cancel.Check());
      TrainView& v = views[i];
      v.view = model.views[i];
      const std::string mask_path = MaskPathOf(masks, v.view.name);
      LITAGS_RETURN_IF_ERROR(LoadPhoto(PathOf(input, v.view.name), mask_path, model.distortions[i],
                                       shadows ? &*shadows : nullptr, &v));
      LITAGS_RETURN_IF_ERROR(CheckMask(v, mask_path));
      flat[i] = FlatColor(v.photo, v.mask);
      if (flat[i].has_value()) return absl::OkStatus();
      Shrink(options.max_image_side, &v);
      return CheckMask(v, mask_path);
    }();
  });
  for (const absl::Status& s : status) LITAGS_RETURN_IF_ERROR(s);
  LoadedViews out;
  int shrunk = 0;
  for (size_t i = 0; i < n; ++i) {
    if (flat[i].has_value()) {
      const auto& [r, g, b] = *flat[i];
      report->notes.push_back(absl::StrFormat("%s is left out: all its pixels are (%d, %d, %d)",
                                              views[i].view.name, r, g, b));
      continue;
    }
    shrunk += views[i].view.camera.width < model.views[i].camera.width;
    out.model_view.push_back(static_cast<int>(i));
    out.views.push_back(std::move(views[i]));
  }
  if (shrunk > 0) {
    report->notes.push_back(absl::StrCat(shrunk, " of ", out.views.size(),
                                         " photos were shrunk to ", options.max_image_side,
                                         " px (max_image_side; 0 keeps their size)"));
  }
  LITAGS_RETURN_IF_ERROR(CheckPhotoCount(out.views.size(), report->photos));
  return out;
}

}  // namespace litags
