#include "engine/sfm/sfm.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <map>
#include <optional>
#include <utility>

#include "absl/functional/function_ref.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "engine/core/error.h"
#include "engine/core/limits.h"
#include "engine/core/monotonic_seconds.h"
#include "engine/io/file_util.h"
#include "engine/io/work_folder.h"
#include "engine/sfm/colmap_version.h"
#include "engine/sfm/exposure.h"
#include "engine/sfm/photo_set.h"
#include "engine/sfm/registration.h"
#include "engine/sfm/rung.h"

namespace litags {
namespace {

namespace fs = std::filesystem;

// One call's inputs and what was measured on them.
struct Capture {
  const std::string& images_dir;
  const std::string dir;  // work_dir/sfm
  const SfmOptions& options;
  const CancelToken& cancel;
  const SfmProgressFn& progress;
  std::vector<PhotoFile> photos;
  LightStats light;
  Exposure exposure = Exposure::kNormal;
};

// Copies and databases are large and of no further use; the logs stay.
void DropBulk(const std::string& rung_dir) {
  std::error_code ignored;  // leftovers are cleared by the next call
  const auto bulk = ListNames(rung_dir, "", [](const fs::directory_entry& entry) {
    return entry.path().extension() != ".log";
  });
  if (!bulk.ok()) return;
  for (const std::string& name : *bulk) fs::remove_all(fs::path(rung_dir) / name, ignored);
}

// Lets the first report of each step through, then one per `least_seconds`.
class ReportLimiter {
 public:
  explicit ReportLimiter(double least_seconds) : least_seconds_(least_seconds) {}

  bool Passes(const std::string& step) {
    const double now = MonotonicSeconds();
    if (step == step_ && now - last_ < least_seconds_) return false;
    step_ = step;
    last_ = now;
    return true;
  }

 private:
  const double least_seconds_;
  std::string step_;
  double last_ = 0;
};

// Refuses a COLMAP of another version. Whatever else is wrong with it, the first step says.
absl::Status CheckVersion(const SfmOptions& options, const CancelToken& cancel) {
  const absl::Status status =
      AskColmapVersion(options.colmap, options.step_timeout_seconds, cancel).status();
  LITAGS_RETURN_IF_ERROR(cancel.Check());
  const auto detail = GetErrorDetail(status);
  return detail && detail->reason == "COLMAP_UNSUPPORTED" ? status : absl::OkStatus();
}

absl::Status Measure(Capture& capture) {
  LITAGS_ASSIGN_OR_RETURN(capture.light, MeasureCapture(capture.images_dir, capture.photos,
                                                        capture.options.threads, capture.cancel));
  capture.exposure = ClassifyExposure(capture.light);
  return absl::OkStatus();
}

// Most photos, then most points.
bool IsBetter(const SfmRung& a, const SfmRung& b) {
  return std::pair(a.registered, a.points) > std::pair(b.registered, b.points);
}

using TryRung = absl::FunctionRef<absl::StatusOr<RungOutput>(const RungInput&)>;

// A signal that ends COLMAP (the kernel short of memory, an operator) says nothing about the
// photos: the rung starts afresh, so that it gives what it would have given undisturbed.
absl::StatusOr<RungOutput> TryUnlessKilled(const RungInput& input, TryRung try_rung) {
  constexpr int kAttempts = 3;
  for (int attempt = 1;; ++attempt) {
    LITAGS_RETURN_IF_ERROR(MakeEmptyFolder(input.dir));
    auto output = try_rung(input);
    const auto detail = GetErrorDetail(output.status());
    if (!detail || detail->reason != "COLMAP_KILLED" || attempt == kAttempts) return output;
  }
}

// Tries the preparations in turn until one is enough; the best of those tried.
absl::StatusOr<SfmResult> Climb(const Capture& capture, TryRung try_rung,
                                absl::FunctionRef<bool(const SfmRung&)> is_enough) {
  const std::vector<Preparation> ladder = Ladder(capture.exposure);
  SfmResult result;
  std::optional<RungOutput> best;
  for (size_t i = 0; i < ladder.size(); ++i) {
    ReportLimiter limiter(capture.options.report_seconds);
    RungInput input = {.images_dir = capture.images_dir,
                       .photos = capture.photos,
                       .options = capture.options,
                       .cancel = capture.cancel,
                       .preparation = ladder[i],
                       .dir = absl::StrCat(capture.dir, "/", i),
                       .report = [&](const char* step, double fraction) {
                         if (!capture.progress || !limiter.Passes(step)) return;
                         capture.progress({.preparation = std::string(PreparationName(ladder[i])),
                                           .step = step,
                                           .rung = static_cast<int>(i),
                                           .rungs = static_cast<int>(ladder.size()),
                                           .fraction = fraction});
                       }};
    auto output = TryUnlessKilled(input, try_rung);
    DropBulk(input.dir);
    LITAGS_RETURN_IF_ERROR(output.status());
    result.rungs.push_back(output->rung);
    if (!best || IsBetter(output->rung, best->rung)) best = *std::move(output);
    if (is_enough(result.rungs.back())) break;
  }
  result.model = std::move(best->model);
  result.photos = std::move(best->photos);
  result.notes = std::move(best->notes);
  result.preparation = best->rung.preparation;
  result.exposure = capture.exposure;
  return result;
}

const SfmRung& KeptRung(const SfmResult& result) {
  for (const SfmRung& rung : result.rungs) {
    if (rung.preparation == result.preparation) return rung;
  }
  return result.rungs.front();
}

void AddNotes(const SfmRung& kept, SfmResult& result) {
  const std::string drops = SummarizeDrops(result.photos);
  if (!drops.empty()) {
    result.notes.push_back(absl::StrCat(result.model.views.size(), " of ", result.photos.size(),
                                        " photos have a camera; left out: ", drops));
  }
  if (kept.groups.size() > 1) {
    result.notes.push_back(absl::StrCat("the photos split into groups of ",
                                        absl::StrJoin(kept.groups, ", "),
                                        "; the largest was taken"));
  }
}

// What the user should know of cameras and lenses. Distortion that nobody would see becomes none:
// taking it out of the photos would cost them sharpness.
void SettleCameras(const std::vector<PhotoFile>& photos, SfmResult& result) {
  constexpr double kSeen = 0.5;  // px
  for (const std::string& note : {SummarizeCameras(photos), SummarizeSharedSizes(photos)}) {
    if (!note.empty()) result.notes.push_back(note);
  }
  double largest = 0;
  for (size_t i = 0; i < result.model.views.size(); ++i) {
    Distortion& distortion = result.model.distortions[i];
    const double shift = LargestShift(result.model.views[i].camera, distortion);
    if (shift <= kSeen) distortion = Distortion();
    if (!distortion.IsZero() && !distortion.fisheye) largest = std::max(largest, shift);
  }
  if (largest == 0) return;
  result.notes.push_back(absl::StrFormat(
      "lens distortion of up to %.1f px was found and is taken out of the photos", largest));
}

// The photo of each given view, with sizes that agree.
absl::StatusOr<std::vector<PhotoFile>> PhotosOfViews(const std::vector<PhotoFile>& photos,
                                                     const SparseModel& cameras) {
  std::map<std::string, const PhotoFile*> by_name;
  for (const PhotoFile& photo : photos) by_name[photo.name] = &photo;
  std::vector<PhotoFile> chosen;
  for (const View& view : cameras.views) {
    const std::string field = absl::StrCat("cameras[", view.name, "]");
    if (!chosen.empty() && chosen.back().name >= view.name) {
      return InvalidInput("CAMERAS_NOT_SORTED", field,
                          absl::StrCat("cameras: \"", view.name, "\" follows \"",
                                       chosen.back().name, "\"; names must be unique and sorted"));
    }
    LITAGS_RETURN_IF_ERROR(view.camera.Validate(field));
    const auto found = by_name.find(view.name);
    if (found == by_name.end()) {
      return MakeError(absl::StatusCode::kNotFound, "VIEW_WITHOUT_PHOTO", field,
                       absl::StrCat("camera \"", view.name,
                                    "\" has no photo of that name; add the photo or leave the "
                                    "camera out"));
    }
    const PhotoFile& photo = *found->second;
    if (photo.width != view.camera.width || photo.height != view.camera.height) {
      return InvalidInput("CAMERA_SIZE_MISMATCH", field,
                          absl::StrCat("camera \"", view.name, "\" is for ", view.camera.width, "x",
                                       view.camera.height, " px, its photo has ", photo.width, "x",
                                       photo.height, "; bring the camera to the photo's size"));
    }
    chosen.push_back(photo);
  }
  return chosen;
}

// Every photo in name order again: those without a given camera were not worked on.
std::vector<SfmPhoto> WithPhotosLeftOut(const std::vector<PhotoFile>& all,
                                        const std::vector<SfmPhoto>& used) {
  std::map<std::string, const SfmPhoto*> by_name;
  for (const SfmPhoto& photo : used) by_name[photo.name] = &photo;
  std::vector<SfmPhoto> photos;
  for (const PhotoFile& photo : all) {
    const auto found = by_name.find(photo.name);
    if (found != by_name.end()) {
      photos.push_back(*found->second);
    } else {
      photos.push_back(
          {.name = photo.name, .drop = DropCause::kNoCamera, .reason = "has no given camera"});
    }
  }
  return photos;
}

absl::Status OutOfRange(std::string_view field, const std::string& rule) {
  return InvalidInput("OUT_OF_RANGE", field, absl::StrCat(std::string(field), " ", rule));
}

// A place is given to as many digits as a file may have.
absl::Status CheckPlaces(const SparseModel& cameras) {
  constexpr double kSameDigits = 1e-9;
  const std::array<double, 3> first = cameras.views[0].camera.Center();
  for (const View& view : cameras.views) {
    const std::array<double, 3> place = view.camera.Center();
    for (int i = 0; i < 3; ++i) {
      if (!(std::abs(place[i] - first[i]) <= kSameDigits * (1 + std::abs(first[i])))) {
        return absl::OkStatus();
      }
    }
  }
  return MakeError(absl::StatusCode::kFailedPrecondition, "SFM_NO_PARALLAX", "cameras",
                   absl::StrCat("the ", cameras.views.size(),
                                " given cameras all stand in one place, as on a tripod: how far "
                                "away things are cannot be told; bring photos from several places, "
                                "with cameras that say where each stands"));
}

}  // namespace

absl::Status SfmOptions::Validate() const {
  if (colmap.empty()) return OutOfRange("colmap", "is empty; name the program");
  if (!(step_timeout_seconds >= 0)) return OutOfRange("step_timeout_seconds", "must be 0 or more");
  return absl::OkStatus();
}

absl::StatusOr<SfmResult> FindCameras(const std::string& images_dir, const std::string& work_dir,
                                      const SfmOptions& options, const CancelToken& cancel,
                                      const SfmProgressFn& progress) {
  const double start = MonotonicSeconds();
  LITAGS_RETURN_IF_ERROR(options.Validate());
  LITAGS_RETURN_IF_ERROR(cancel.Check());
  Capture capture = {images_dir, work_dir + "/sfm", options, cancel, progress, {}, {}};
  LITAGS_ASSIGN_OR_RETURN(capture.photos, ListPhotoSet(images_dir, options.max_image_side,
                                                       options.masks, options.rig_views));
  const int n = static_cast<int>(capture.photos.size());
  LITAGS_RETURN_IF_ERROR(CheckPhotoCount(n, n));
  LITAGS_RETURN_IF_ERROR(CheckVersion(options, cancel));
  LITAGS_RETURN_IF_ERROR(MakeEmptyFolder(capture.dir));
  LITAGS_RETURN_IF_ERROR(Measure(capture));

  const int enough = static_cast<int>(std::ceil(options.enough_registered * n - 1e-9));
  LITAGS_ASSIGN_OR_RETURN(SfmResult result, Climb(capture, MapPhotos, [&](const SfmRung& rung) {
                            return rung.registered >= enough;
                          }));
  const SfmRung& kept = KeptRung(result);
  LITAGS_RETURN_IF_ERROR(JudgeRegistration(kept, result.photos, options));
  AddNotes(kept, result);
  SettleCameras(capture.photos, result);
  result.seconds = MonotonicSeconds() - start;
  return result;
}

absl::StatusOr<SfmResult> TriangulatePoints(const std::string& images_dir,
                                            const SparseModel& cameras, const std::string& work_dir,
                                            const SfmOptions& options, const CancelToken& cancel,
                                            const SfmProgressFn& progress) {
  const double start = MonotonicSeconds();
  LITAGS_RETURN_IF_ERROR(options.Validate());
  LITAGS_RETURN_IF_ERROR(cancel.Check());
  if (cameras.views.size() < 2 || cameras.distortions.size() != cameras.views.size()) {
    return InvalidInput("TOO_FEW_CAMERAS", "cameras",
                        absl::StrCat("cameras: ", cameras.views.size(),
                                     " views; at least 2 are needed, each with its distortion"));
  }
  LITAGS_RETURN_IF_ERROR(CheckPlaces(cameras));
  Capture capture = {images_dir, work_dir + "/sfm", options, cancel, progress, {}, {}};
  LITAGS_ASSIGN_OR_RETURN(
      const std::vector<PhotoFile> all,
      ListPhotoSet(images_dir, options.max_image_side, options.masks, options.rig_views));
  LITAGS_ASSIGN_OR_RETURN(capture.photos, PhotosOfViews(all, cameras));
  LITAGS_RETURN_IF_ERROR(CheckVersion(options, cancel));
  LITAGS_RETURN_IF_ERROR(MakeEmptyFolder(capture.dir));
  LITAGS_RETURN_IF_ERROR(Measure(capture));

  const int64_t enough = kEnoughPointsPerView * static_cast<int64_t>(cameras.views.size());
  LITAGS_ASSIGN_OR_RETURN(
      SfmResult result,
      Climb(
          capture, [&](const RungInput& input) { return TriangulatePhotos(input, cameras); },
          [&](const SfmRung& rung) { return rung.points >= enough; }));
  if (result.model.points.empty()) {
    return MakeError(
        absl::StatusCode::kFailedPrecondition, "SFM_NO_POINTS", "cameras",
        absl::StrCat("no point of the scene is seen alike by the ", cameras.views.size(),
                     " given cameras; check that cameras and photos belong together, that "
                     "the axes are right, that the cameras do not all stand in almost one place, "
                     "and that the photos show texture: a place that is black but for a lamp, or a "
                     "bare wall, shows none"));
  }
  result.photos = WithPhotosLeftOut(all, result.photos);
  AddNotes(KeptRung(result), result);
  result.seconds = MonotonicSeconds() - start;
  return result;
}

}  // namespace litags
