#include "engine/pipeline/camera_source.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "engine/core/error.h"
#include "engine/io/colmap_io.h"
#include "engine/io/file_util.h"
#include "engine/io/image_io.h"
#include "engine/pipeline/fingerprint.h"
#include "engine/sfm/sfm.h"

namespace litags {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

constexpr int64_t kMaxRegistrationFile = int64_t{64} << 20;
constexpr int64_t kMaxCameraFile = int64_t{2} << 30;

// JSON text; names of files need not be UTF-8.
std::string Dump(const Json& json) {
  return json.dump(1, ' ', false, Json::error_handler_t::replace);
}

// What cannot be read is left to those who need it to complain about.
void AddFile(const std::string& path, int64_t max_bytes, Fingerprint* f) {
  const auto bytes = ReadFile(path, "", max_bytes);
  if (bytes.ok()) f->Add(bytes->data(), bytes->size());
}

// Of the files that ReadCameras reads.
std::string FingerprintOfCameras(const std::string& path) {
  Fingerprint f;
  for (const char* name : {"", "/cameras.bin", "/images.bin", "/points3D.bin", "/cameras.txt",
                           "/images.txt", "/points3D.txt"}) {
    std::error_code ignored;
    if (fs::is_regular_file(path + name, ignored)) AddFile(path + name, kMaxCameraFile, &f);
  }
  return f.Text();
}

std::string FingerprintOfPhoto(const std::string& path) {
  Fingerprint f;
  AddFile(path, ImageLimits().max_bytes, &f);
  return f.Text();
}

std::string FingerprintOfMasks(const MaskPaths& masks) {
  Fingerprint f;
  for (const auto& [photo, path] : masks) {
    f.Add(photo.data(), photo.size());
    AddFile(path, ImageLimits().max_bytes, &f);
  }
  return f.Text();
}

// What the cameras were found from. Kept cameras of anything else are not used.
Json SourceOf(const ReconstructInput& input, const std::vector<std::string>& photos,
              const MaskPaths& masks) {
  Json fingerprints = Json::array();
  for (const std::string& photo : photos) {
    fingerprints.push_back({photo, FingerprintOfPhoto(input.images_dir + "/" + photo)});
  }
  // Not where they lie: a job's folder moves from lease to lease.
  Json source = {{"given", !input.cameras_path.empty()}, {"photos", fingerprints}};
  if (!input.cameras_path.empty()) {
    source["fingerprint"] = FingerprintOfCameras(input.cameras_path);
  }
  if (!masks.empty()) source["masks"] = FingerprintOfMasks(masks);
  return Json::parse(Dump(source));  // as it will be read back
}

// Renames the views to the photos they belong to (same name, else same stem) and drops views
// without a photo, with their marks in tracks. INVALID_ARGUMENT if two are of one photo.
absl::StatusOr<SparseModel> MatchPhotos(SparseModel model, const std::vector<std::string>& photos) {
  std::map<std::string, std::string> by_name, by_stem;
  for (const std::string& photo : photos) {
    by_name[photo] = photo;
    by_stem[Stem(photo)] = photo;
  }
  SparseModel out;
  std::set<std::string> taken;
  std::vector<int> new_index(model.views.size(), -1);
  for (size_t i = 0; i < model.views.size(); ++i) {
    const auto named = by_name.find(model.views[i].name);
    const auto stemmed = by_stem.find(Stem(model.views[i].name));
    if (named == by_name.end() && stemmed == by_stem.end()) continue;
    const std::string& photo = named != by_name.end() ? named->second : stemmed->second;
    if (!taken.insert(photo).second) {
      return InvalidInput("DUPLICATE_CAMERA", "cameras",
                          absl::StrCat("cameras: photo ", photo, " has two cameras, the second as ",
                                       model.views[i].name, "; keep one"));
    }
    new_index[i] = static_cast<int>(out.views.size());
    out.views.push_back(std::move(model.views[i]));
    out.views.back().name = photo;
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
absl::Status SaveRegistration(const std::string& dir, const Json& source, const SparseModel& model,
                              const ReconstructReport& report) {
  std::error_code ignored;  // writing reports what matters
  fs::create_directories(dir, ignored);
  fs::remove(dir + "/registration.json", ignored);
  LITAGS_RETURN_IF_ERROR(WriteColmapModel(dir, model));
  const Json json = {{"dropped", report.dropped},
                     {"preparation", report.sfm_preparation},
                     {"notes", report.notes},
                     {"source", source}};
  // Last: its presence says that the folder is whole.
  return WriteFileAtomically(dir + "/registration.json", Dump(json));
}

// Nothing if the cameras in `dir` were found from something else than `source`.
absl::StatusOr<std::optional<SparseModel>> LoadRegistration(const std::string& dir,
                                                            const Json& source,
                                                            ReconstructReport* report) {
  LITAGS_ASSIGN_OR_RETURN(const std::string text,
                          ReadFile(dir + "/registration.json", "cameras", kMaxRegistrationFile));
  const Json json = Json::parse(text, nullptr, /*allow_exceptions=*/false);
  if (!json.is_object() || !json.contains("dropped") || !json.contains("preparation") ||
      !json.contains("notes")) {
    return MakeError(absl::StatusCode::kDataLoss, "REGISTRATION_CORRUPT", "cameras",
                     absl::StrCat(dir, "/registration.json is damaged"));
  }
  if (json.value("source", Json()) != source) return std::nullopt;
  LITAGS_ASSIGN_OR_RETURN(SparseModel model, ReadColmapModel(dir, "cameras"));
  try {
    auto dropped = json["dropped"].get<std::vector<std::string>>();
    auto preparation = json["preparation"].get<std::string>();
    report->notes = json["notes"].get<std::vector<std::string>>();
    report->dropped = std::move(dropped);
    report->sfm_preparation = std::move(preparation);
  } catch (const Json::exception& e) {
    return MakeError(absl::StatusCode::kDataLoss, "REGISTRATION_CORRUPT", "cameras",
                     absl::StrCat(dir, "/registration.json: ", e.what()));
  }
  report->registered = static_cast<int>(model.views.size());
  report->sparse_points = static_cast<int64_t>(model.points.size());
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
                                          const MaskPaths& masks, const std::string& colmap,
                                          const CancelToken& cancel, const StageReport& progress,
                                          ReconstructReport* report) {
  report->photos = static_cast<int>(photos.size());
  const std::string kept = input.work_dir + "/cameras";
  const Json source = SourceOf(input, photos, masks);
  std::string damage;
  if (fs::exists(kept + "/registration.json")) {
    absl::StatusOr<std::optional<SparseModel>> found = LoadRegistration(kept, source, report);
    if (found.ok() && found->has_value()) return **std::move(found);
    if (!found.ok()) damage = std::string(found.status().message());
  }

  SfmOptions sfm;
  sfm.colmap = colmap;
  sfm.threads = options.threads;
  sfm.seed = options.seed;
  sfm.min_registered = options.min_registered;
  sfm.step_timeout_seconds = input.colmap_step_seconds;
  sfm.masks = masks;
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
    LITAGS_ASSIGN_OR_RETURN(model, MatchPhotos(std::move(given), photos));
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
    if (!report->dropped.empty()) {
      report->notes.push_back(absl::StrCat(report->dropped.size(), " of ", photos.size(),
                                           " photos have no camera and are left out, such as ",
                                           report->dropped[0]));
    }
    report->sfm_preparation = "given";
  }
  LITAGS_RETURN_IF_ERROR(SaveRegistration(kept, source, model, *report));
  // Read back, so that this run and a resumed one see the same digits.
  LITAGS_ASSIGN_OR_RETURN(std::optional<SparseModel> read_back,
                          LoadRegistration(kept, source, report));
  if (!read_back.has_value()) return absl::InternalError("cameras changed while they were kept");
  if (!damage.empty()) {
    report->notes.push_back(absl::StrCat("the cameras kept from an earlier run could not be used (",
                                         damage, "); they were found again"));
  }
  return *std::move(read_back);
}

}  // namespace litags
