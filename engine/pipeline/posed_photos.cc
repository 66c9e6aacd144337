#include "engine/pipeline/posed_photos.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <set>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "engine/core/camera_spread.h"
#include "engine/core/error.h"
#include "engine/core/limits.h"
#include "engine/core/mask.h"
#include "engine/core/parallel.h"
#include "engine/core/shrunk_size.h"
#include "engine/core/spread_indices.h"
#include "engine/io/file_util.h"
#include "engine/io/image_io.h"
#include "engine/io/mask_io.h"
#include "engine/pipeline/camera_source.h"
#include "engine/pipeline/capture_checks.h"
#include "engine/pipeline/fingerprint.h"
#include "engine/pipeline/local_origin.h"
#include "engine/pipeline/memory_estimate.h"
#include "engine/pipeline/photo_look.h"
#include "engine/pipeline/photo_place.h"
#include "engine/pipeline/photo_progress.h"
#include "engine/pipeline/photo_screen.h"
#include "engine/pipeline/wide_photos.h"
#include "engine/pipeline/wide_views.h"
#include "engine/prior/structure_prior.h"
#include "engine/target/noise_floor.h"
#include "engine/target/shadow_color.h"
#include "engine/target/tone.h"

namespace litags {
namespace {

std::string MaskPathOf(const MaskPaths& masks, const std::string& name) {
  const auto mask = masks.find(name);
  return mask == masks.end() ? "" : mask->second;
}

// What a view's PNG does not say stands in the file that it was cut from.
absl::StatusOr<MaskedPhoto> ReadInputPhoto(const CutInput& input, const std::string& name,
                                           const MaskPaths& masks) {
  LITAGS_ASSIGN_OR_RETURN(
      MaskedPhoto read,
      ReadMaskedPhoto(PhotoPath(input, name), PhotoField(name), MaskPathOf(masks, name)));
  const auto view = input.rig_views.find(name);
  if (view == input.rig_views.end()) return read;
  const RigView& source = view->second;
  read.info.exposure_time = source.exposure_time;
  read.info.iso = source.iso;
  read.info.f_number = source.f_number;
  read.info.chroma_step = source.chroma_step;
  return read;
}

// Of photos spread over the capture, as the camera wrote them.
absl::StatusOr<ColorPrior> MeasureColors(const CutInput& input, const SparseModel& model,
                                         const MaskPaths& masks, int threads,
                                         const CancelToken& cancel) {
  const std::vector<size_t> views = SpreadIndices(model.views.size(), kPhotosOfColors);
  std::vector<std::optional<ColorPrior>> of_views(views.size());
  std::vector<absl::Status> status(views.size());
  ParallelFor(threads, views.size(), [&](size_t i, int) {
    status[i] = [&]() -> absl::Status {
      LITAGS_RETURN_IF_ERROR(cancel.Check());
      LITAGS_ASSIGN_OR_RETURN(const MaskedPhoto read,
                              ReadInputPhoto(input, model.views[views[i]].name, masks));
      if (FlatColor(read.photo, read.mask).has_value()) return absl::OkStatus();  // left out
      const FileSteps steps = {CodeStep(read.info), static_cast<double>(read.info.chroma_step)};
      of_views[i] = MeasureColorPrior(read.photo, steps, read.mask);
      return absl::OkStatus();
    }();
  });
  for (const absl::Status& s : status) LITAGS_RETURN_IF_ERROR(s);
  std::vector<ColorPrior> priors;
  for (const auto& prior : of_views) {
    if (prior.has_value()) priors.push_back(*prior);
  }
  return MedianPrior(priors);
}

// One photo on its way to the size of training.
struct OnePhoto {
  View view;
  Photo photo;
  PlaneU8 mask;
  std::string source;            // as PosedPhotos has it
  PhotoDarkness darkness;        // as the camera wrote it
  NoiseLevels written, resized;  // as the camera wrote it; at the size of training
  double stated_exposure = 0;    // as StatedExposure has it
  double code_step = 1;          // as CodeStep has it
  bool rim_masked = false;       // the pinhole picture shows more than the photo
  std::string no_use;            // what keeps it out: "is of one colour"; else empty
};

// By EXIF, in a unit of its own; 0: not said.
double StatedExposure(const ImageInfo& info) {
  if (!(info.exposure_time > 0 && info.iso > 0 && info.f_number > 0)) return 0;
  return info.exposure_time * info.iso / (info.f_number * info.f_number);
}

// Pixels of the pinhole picture that the photo does not have do not count.
absl::Status MaskRim(const Distortion& distortion, OnePhoto* v) {
  LITAGS_ASSIGN_OR_RETURN(PlaneU8 rim, MaskOfUndistorted(v->view.camera, distortion));
  if (rim.empty()) return absl::OkStatus();
  if (!v->mask.empty()) ForMasked(v->mask, [&](size_t i) { rim.data[i] = 0; });
  v->mask = std::move(rim);
  FillMasked(v->mask, &v->photo);
  v->rim_masked = true;
  return absl::OkStatus();
}

// Photo and mask as their pinhole camera sees them.
absl::Status LoadPhoto(const CutInput& input, const MaskPaths& masks, const Distortion& distortion,
                       OnePhoto* v) {
  const std::string& name = v->view.name;
  // Of the file's bytes: what decoders and filters make of them may differ in the last bits from
  // processor to processor.
  Fingerprint source;
  LITAGS_RETURN_IF_ERROR(
      source.AddFile(PhotoPath(input, name), PhotoField(name), ImageLimits().max_bytes));
  LITAGS_ASSIGN_OR_RETURN(MaskedPhoto read, ReadInputPhoto(input, name, masks));
  source.Add(read.mask.data.data(), read.mask.data.size());
  v->source = source.Text();
  v->stated_exposure = StatedExposure(read.info);
  v->code_step = CodeStep(read.info);
  v->photo = std::move(read.photo);
  v->mask = std::move(read.mask);
  v->darkness = MeasureDarkness(v->photo, v->mask, read.info);
  v->written = NoiseLevels(v->photo, v->mask);
  const Camera& camera = v->view.camera;
  if (v->photo.width != camera.width || v->photo.height != camera.height) {
    return InvalidInput(
        "CAMERA_SIZE_MISMATCH", PhotoField(v->view.name),
        absl::StrCat(v->view.name, ": the photo is ", v->photo.width, "x", v->photo.height,
                     " but its camera says ", camera.width, "x", camera.height,
                     "; send the photo as it was when its camera was found, or "
                     "delete the folder cameras of this run"));
  }
  if (distortion.IsZero()) return absl::OkStatus();
  absl::Status status;
  const auto undistort = [&]<class T>(const Image<T>& image) {
    absl::StatusOr<Image<T>> pinhole = Undistort(image, camera, distortion);
    status.Update(pinhole.status());
    return pinhole.ok() ? *std::move(pinhole) : Image<T>();
  };
  v->photo = undistort(v->photo);
  if (!v->mask.empty()) v->mask = ChangeMask(v->mask, undistort);
  LITAGS_RETURN_IF_ERROR(status);
  return MaskRim(distortion, v);
}

// To the size of training. How many of the camera's pixels one is wide then.
double Shrink(int max_side, OnePhoto* v) {
  Camera& camera = v->view.camera;
  const auto [width, height] = ShrunkSize(camera.width, camera.height, max_side);
  if (width == camera.width && height == camera.height) return 1;
  const double shrunk = static_cast<double>(camera.width) / width;
  const auto resize = [width = width, height = height](const auto& image) {
    return ResizeArea(image, width, height);
  };
  v->photo = resize(v->photo);
  if (!v->mask.empty()) v->mask = ChangeMask(v->mask, resize);
  camera = camera.Scaled(width, height);
  return shrunk;
}

// A mask may leave something of the photo as it was taken, and nothing at the size of training.
absl::Status CheckMask(const OnePhoto& v, const std::string& mask_path) {
  if (CountedPixels(v.mask, v.photo.pixels()) > 0) return absl::OkStatus();
  const std::string field = mask_path.empty() ? PhotoField(v.view.name)
                                              : absl::StrCat("masks[", BaseName(mask_path), "]");
  return InvalidInput("MASK_BLACK", field,
                      absl::StrCat(field, ": at ", v.mask.width, "x", v.mask.height,
                                   " px, the size of training, no pixel of the photo counts; "
                                   "leave the photo out"));
}

// The photos of the model's views, at the size of training; those of no use may be as they were.
absl::StatusOr<std::vector<OnePhoto>> LoadPhotos(const Context& context, const MaskPaths& masks,
                                                 const SparseModel& model) {
  const CutInput& input = context.input;
  const ReconstructOptions& options = context.options;
  const size_t n = model.views.size();
  std::vector<OnePhoto> photos(n);
  std::vector<absl::Status> status(n);
  std::optional<ShadowColors> shadows;
  if (context.recipe.tone.rule == Tone::kCapture) {
    LITAGS_ASSIGN_OR_RETURN(const ColorPrior colors,
                            MeasureColors(input, model, masks, options.threads, context.cancel));
    shadows.emplace(colors);
  }
  PhotoProgress loaded([&](const std::string& line) { context.progress(Stage::kPreparing, line); },
                       "loading photos", n);
  ParallelFor(options.threads, n, [&](size_t i, int thread) {
    status[i] = [&]() -> absl::Status {
      LITAGS_RETURN_IF_ERROR(context.cancel.Check());
      OnePhoto& v = photos[i];
      v.view = model.views[i];
      const std::string mask_path = MaskPathOf(masks, v.view.name);
      LITAGS_RETURN_IF_ERROR(LoadPhoto(input, masks, model.distortions[i], &v));
      LITAGS_RETURN_IF_ERROR(CheckMask(v, mask_path));
      if (const auto flat = FlatColor(v.photo, v.mask); flat.has_value()) {
        v.no_use = DescribeFlat(*flat);
        return absl::OkStatus();
      }
      const double shrunk = Shrink(options.max_image_side, &v);
      v.resized = NoiseLevels(v.photo, v.mask);
      bool black = IsBlack(v.photo, v.mask, context.recipe.tone.rule);
      if (shadows.has_value()) {
        v.photo = shadows->Infer(v.photo, v.mask, shrunk);
        black = black || IsBlack(v.photo, v.mask, context.recipe.tone.rule);
      }
      const int width = v.photo.width, height = v.photo.height;
      if (black) {
        v.no_use = DescribeFlat({0, 0, 0});
      } else if (std::min(width, height) < LeastPriorSide(width, height)) {
        v.no_use = absl::StrCat("is only ", width, "x", height, " px in size");
      }
      return CheckMask(v, mask_path);
    }();
    loaded.Done(thread);
  });
  for (const absl::Status& s : status) LITAGS_RETURN_IF_ERROR(s);
  return photos;
}

// Puts those that show something into the fields of `posed`.
void TakePhotos(const Context& context, std::vector<OnePhoto> photos, PosedPhotos* posed) {
  const SparseModel& model = posed->model;
  int shrunk = 0, rims = 0;
  std::vector<PhotoDarkness> darkness;
  NoiseLevels written, resized;
  for (size_t i = 0; i < photos.size(); ++i) {
    if (!photos[i].no_use.empty()) {
      context.Note(absl::StrCat(photos[i].view.name, " is left out: it ", photos[i].no_use));
      context.report->dropped.push_back(photos[i].view.name);
      --context.report->registered;
      continue;
    }
    shrunk += photos[i].view.camera.width < model.views[i].camera.width;
    rims += photos[i].rim_masked;
    posed->model_view.push_back(static_cast<int>(i));
    posed->views.push_back(std::move(photos[i].view));
    posed->distortions.push_back(model.distortions[i]);
    posed->photos.push_back(std::move(photos[i].photo));
    posed->masks.push_back(std::move(photos[i].mask));
    posed->sources.push_back(std::move(photos[i].source));
    darkness.push_back(photos[i].darkness);
    written.Add(photos[i].written);
    resized.Add(photos[i].resized);
    posed->stated_exposures.push_back(photos[i].stated_exposure);
    posed->code_step = std::max(posed->code_step, photos[i].code_step);
  }
  posed->noise_floor = written.Floor();
  if (resized.Variance() > 0) {
    posed->noise_kept = std::min(1.0, std::sqrt(resized.Variance() / written.Variance()));
  }
  if (!darkness.empty()) NoteDarkness(posed->views, darkness, &context.report->notes);
  if (rims > 0) {
    context.Note(absl::StrCat(rims, " of ", posed->size(), " photos show less than the picture ",
                              "without their lens's distortion: the rest, at its rim, is masked"));
  }
  if (shrunk > 0) {
    context.Note(absl::StrCat(shrunk, " of ", posed->size(), " photos were shrunk to ",
                              context.options.max_image_side,
                              " px (max_image_side; 0 keeps their size)"));
  }
}

absl::Status CheckMemoryOf(const Context& context, const PhotoScreen& screen,
                           const std::vector<ScreenedPhoto>& photos) {
  const CutInput& input = context.input;
  return CheckMemory(photos, context.options,
                     MapsOf(photos, input, context.options, !screen.masks.empty()),
                     input.memory_bytes);
}

// Those that are trained on: of given cameras there may be fewer than photos.
std::vector<ScreenedPhoto> WithCamera(std::vector<ScreenedPhoto> photos, const SparseModel& model) {
  std::set<std::string> names;
  for (const View& view : model.views) names.insert(view.name);
  std::erase_if(photos, [&](const ScreenedPhoto& photo) { return !names.contains(photo.name); });
  return photos;
}

// They count for nothing but what they see (SceneExtent, FrameOfViews, LocalOrigin).
void NoteFarCameras(const Context& context, const std::vector<View>& views) {
  const std::vector<bool> far = FarCameras(views);
  for (size_t i = 0; i < views.size(); ++i) {
    if (!far[i]) continue;
    context.Note(absl::StrCat("the camera of ", views[i].name,
                              " stands far from all others: the scene's size and orbits do not "
                              "count it; check it, or leave the photo out"));
  }
}

// Of photos whose cameras were found and kept: as if these had been given.
absl::StatusOr<PosedPhotos> LoadViewsOfFisheyes(const Context& context, const std::string& colmap) {
  ReconstructReport* const report = context.report;
  const std::string preparation = report->sfm_preparation;
  report->dropped.clear();  // those without a camera will be found without one again
  CutInput solved = context.input;
  solved.cameras_path = SolvedFisheyes(solved);
  solved.cameras_are_upright = true;
  LITAGS_ASSIGN_OR_RETURN(const CutInput cut, WithViewsOfWidePhotos(
                                                  solved, context.options.threads, context.cancel,
                                                  [&](const std::string& line) {
                                                    context.progress(Stage::kFindingCameras, line);
                                                  },
                                                  &report->notes));
  const Context of_views(cut, context.options, context.cancel, context.progress, report,
                         context.on_line);
  auto posed = LoadPosedPhotos(of_views, colmap);
  report->sfm_preparation = preparation;
  return posed;
}

}  // namespace

absl::StatusOr<PosedPhotos> LoadPosedPhotos(const Context& context, const std::string& colmap) {
  const CutInput& input = context.input;
  context.progress(Stage::kLoading, "reading photos");
  LITAGS_ASSIGN_OR_RETURN(std::string others, DescribeOtherPictures(input.images_dir, "images"));
  if (!others.empty()) context.Note(std::move(others));
  LITAGS_ASSIGN_OR_RETURN(
      const PhotoScreen screen,
      ScreenPhotos(input, context.options.threads, context.cancel,
                   [&](const std::string& line) { context.progress(Stage::kLoading, line); }));
  std::vector<std::string>* const notes = &context.report->notes;
  const auto before_screen = static_cast<ptrdiff_t>(notes->size());
  notes->insert(notes->end(), screen.notes.begin(), screen.notes.end());
  LITAGS_RETURN_IF_ERROR(CheckPhotosLeft(screen.photos.size(), screen.left_out));
  const bool given = !input.cameras_path.empty();
  if (!given) LITAGS_RETURN_IF_ERROR(CheckMemoryOf(context, screen, screen.photos));
  PosedPhotos posed;
  LITAGS_ASSIGN_OR_RETURN(posed.model,
                          ObtainCameras(context, screen.Names(), screen.masks, colmap));
  if (given) {
    LITAGS_RETURN_IF_ERROR(CheckMemoryOf(context, screen, WithCamera(screen.photos, posed.model)));
  }
  for (const PhotoLeftOut& photo : screen.left_out) context.report->dropped.push_back(photo.name);
  context.report->photos += static_cast<int>(screen.left_out.size());
  LITAGS_RETURN_IF_ERROR(context.cancel.Check());
  if (input.cameras_path.empty() && HasWideFisheye(posed.model)) {
    // Their views are screened again, which says it again.
    const auto first = notes->begin() + before_screen;
    notes->erase(first, first + static_cast<ptrdiff_t>(screen.notes.size()));
    return LoadViewsOfFisheyes(context, colmap);
  }
  posed.rig_views = input.rig_views;
  posed.origin = LocalOrigin(posed.model.views);
  if (posed.origin != std::array<double, 3>{}) {
    TakeAsOrigin(posed.origin, &posed.model);
    context.Note(DescribeOrigin(posed.origin));
  }
  context.progress(Stage::kPreparing, "loading photos");
  LITAGS_ASSIGN_OR_RETURN(std::vector<OnePhoto> photos,
                          LoadPhotos(context, screen.masks, posed.model));
  TakePhotos(context, std::move(photos), &posed);
  context.progress(Stage::kPreparing, "pseudo-targets and structure maps");
  LITAGS_RETURN_IF_ERROR(CheckPhotoCount(posed.size(), context.report->photos));
  NoteFarCameras(context, posed.views);
  return posed;
}

}  // namespace litags
