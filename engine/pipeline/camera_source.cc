#include "engine/pipeline/camera_source.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "engine/core/error.h"
#include "engine/io/colmap_io.h"
#include "engine/io/file_util.h"
#include "engine/io/image_io.h"
#include "engine/sfm/sfm.h"

namespace litags {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

constexpr int64_t kMaxRegistrationFile = int64_t{64} << 20;

// Renames the views to the photos they belong to (same name, else same stem) and drops views
// without a photo, with their marks in tracks.
SparseModel MatchPhotos(SparseModel model, const std::vector<std::string>& photos) {
  std::map<std::string, std::string> by_name, by_stem;
  for (const std::string& photo : photos) {
    by_name[photo] = photo;
    by_stem[Stem(photo)] = photo;
  }
  SparseModel out;
  std::vector<int> new_index(model.views.size(), -1);
  for (size_t i = 0; i < model.views.size(); ++i) {
    const auto named = by_name.find(model.views[i].name);
    const auto stemmed = by_stem.find(Stem(model.views[i].name));
    if (named == by_name.end() && stemmed == by_stem.end()) continue;
    new_index[i] = static_cast<int>(out.views.size());
    out.views.push_back(std::move(model.views[i]));
    out.views.back().name = named != by_name.end() ? named->second : stemmed->second;
    out.distortions.push_back(model.distortions[i]);
  }
  out.points = std::move(model.points);
  for (SparsePoint& point : out.points) {
    std::erase_if(point.track, [&](const TrackElement& e) { return new_index[e.view] < 0; });
    for (TrackElement& e : point.track) e.view = new_index[e.view];
  }
  return out;
}

// Registration that COLMAP produced, next to the model in work_dir/cameras.
absl::Status SaveRegistration(const std::string& dir, const SparseModel& model,
                              const ReconstructReport& report) {
  std::error_code error;
  fs::create_directories(dir, error);
  LITAGS_RETURN_IF_ERROR(WriteColmapModel(dir, model));
  const Json json = {{"dropped", report.dropped},
                     {"preparation", report.sfm_preparation},
                     {"notes", report.notes}};
  // Last: its presence says that the folder is whole.
  return WriteFileAtomically(dir + "/registration.json", json.dump(1));
}

absl::StatusOr<SparseModel> LoadRegistration(const std::string& dir, ReconstructReport* report) {
  LITAGS_ASSIGN_OR_RETURN(SparseModel model, ReadColmapModel(dir, "cameras"));
  LITAGS_ASSIGN_OR_RETURN(const std::string text,
                          ReadFile(dir + "/registration.json", "cameras", kMaxRegistrationFile));
  const Json json = Json::parse(text, nullptr, /*allow_exceptions=*/false);
  if (!json.is_object() || !json.contains("dropped") || !json.contains("preparation") ||
      !json.contains("notes")) {
    return MakeError(absl::StatusCode::kDataLoss, "REGISTRATION_CORRUPT", "cameras",
                     absl::StrCat(dir, "/registration.json is damaged; delete ", dir,
                                  " to find the cameras again"));
  }
  try {
    report->dropped = json["dropped"].get<std::vector<std::string>>();
    report->sfm_preparation = json["preparation"].get<std::string>();
    report->notes = json["notes"].get<std::vector<std::string>>();
  } catch (const Json::exception& e) {
    return MakeError(absl::StatusCode::kDataLoss, "REGISTRATION_CORRUPT", "cameras",
                     absl::StrCat(dir, "/registration.json: ", e.what()));
  }
  return model;
}

std::string Describe(const SfmProgress& p) {
  std::string text = absl::StrCat(p.step, " (", p.preparation, ")");
  if (p.fraction > 0) absl::StrAppend(&text, " ", static_cast<int>(100 * p.fraction), " %");
  return text;
}

void FillReport(const SfmResult& result, ReconstructReport* report) {
  report->sfm_preparation = result.preparation;
  for (const SfmPhoto& photo : result.photos) {
    if (photo.registered()) continue;
    report->dropped.push_back(photo.name);
    report->notes.push_back(absl::StrCat(photo.name, " is left out: ", photo.reason));
  }
  report->notes.insert(report->notes.end(), result.notes.begin(), result.notes.end());
}

// Photos of given cameras come with a size; it may be given for another resolution of the photos.
absl::Status FitToPhotos(const std::string& images_dir, SparseModel* model) {
  for (size_t i = 0; i < model->views.size(); ++i) {
    View& view = model->views[i];
    const std::string field = absl::StrCat("images[", view.name, "]");
    LITAGS_ASSIGN_OR_RETURN(const ImageInfo info,
                            ReadImageSize(images_dir + "/" + view.name, field));
    if (info.width == view.camera.width && info.height == view.camera.height) continue;
    const double sx = double(info.width) / view.camera.width;
    const double sy = double(info.height) / view.camera.height;
    if (std::abs(sx / sy - 1) > 0.02) {
      return InvalidInput("CAMERA_SIZE_MISMATCH", field,
                          absl::StrCat(view.name, ": the photo is ", info.width, "x", info.height,
                                       " but its camera says ", view.camera.width, "x",
                                       view.camera.height, "; give cameras of these photos"));
    }
    view.camera = view.camera.Scaled(info.width, info.height);
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<SparseModel> ObtainCameras(const ReconstructInput& input,
                                          const ReconstructOptions& options,
                                          const std::vector<std::string>& photos,
                                          const std::string& colmap, const CancelToken& cancel,
                                          const StageReport& progress, ReconstructReport* report) {
  report->photos = static_cast<int>(photos.size());
  const std::string kept = input.work_dir + "/cameras";
  if (fs::exists(kept + "/registration.json")) {
    LITAGS_ASSIGN_OR_RETURN(SparseModel model, LoadRegistration(kept, report));
    report->registered = static_cast<int>(model.views.size());
    report->sparse_points = static_cast<int64_t>(model.points.size());
    return model;
  }

  SfmOptions sfm;
  sfm.colmap = colmap;
  sfm.threads = options.threads;
  sfm.seed = options.seed;
  sfm.min_registered = options.min_registered;
  const auto on_progress = [&](const SfmProgress& p) {
    progress(Stage::kFindingCameras, Describe(p));
  };
  SparseModel model;
  if (input.cameras_path.empty()) {
    LITAGS_ASSIGN_OR_RETURN(
        SfmResult result, FindCameras(input.images_dir, input.work_dir, sfm, cancel, on_progress));
    FillReport(result, report);
    model = std::move(result.model);
  } else {
    LITAGS_ASSIGN_OR_RETURN(
        const ImageInfo first,
        ReadImageSize(input.images_dir + "/" + photos[0], absl::StrCat("images[", photos[0], "]")));
    LITAGS_ASSIGN_OR_RETURN(SparseModel given,
                            ReadCameras(input.cameras_path, "cameras", first.width, first.height));
    model = MatchPhotos(std::move(given), photos);
    if (model.views.empty()) {
      return InvalidInput(
          "NO_MATCHING_CAMERAS", "cameras",
          absl::StrCat("cameras: none of the ", photos.size(),
                       " photos has a camera; file_path must end in the photos' names, as ",
                       photos[0]));
    }
    LITAGS_RETURN_IF_ERROR(FitToPhotos(input.images_dir, &model));
    if (model.points.empty()) {
      LITAGS_ASSIGN_OR_RETURN(
          SfmResult result,
          TriangulatePoints(input.images_dir, model, input.work_dir, sfm, cancel, on_progress));
      for (const std::string& note : result.notes) report->notes.push_back(note);
      model = std::move(result.model);
    }
    std::set<std::string> placed;
    for (const View& view : model.views) placed.insert(view.name);
    for (const std::string& photo : photos) {
      if (!placed.contains(photo)) report->dropped.push_back(photo);
    }
    report->sfm_preparation = "given";
  }
  LITAGS_RETURN_IF_ERROR(SaveRegistration(kept, model, *report));
  // Read back, so that this run and a resumed one see the same digits.
  ReconstructReport ignored;
  LITAGS_ASSIGN_OR_RETURN(model, LoadRegistration(kept, &ignored));
  report->registered = static_cast<int>(model.views.size());
  report->sparse_points = static_cast<int64_t>(model.points.size());
  return model;
}

}  // namespace litags
