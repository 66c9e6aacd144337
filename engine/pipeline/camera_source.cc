#include "engine/pipeline/camera_source.h"

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "engine/core/error.h"
#include "engine/core/json_text.h"
#include "engine/io/bundler_io.h"
#include "engine/io/cameras_io.h"
#include "engine/io/colmap_io.h"
#include "engine/io/file_util.h"
#include "engine/io/image_io.h"
#include "engine/io/work_folder.h"
#include "engine/pipeline/fingerprint.h"
#include "engine/pipeline/given_cameras.h"
#include "engine/pipeline/local_origin.h"
#include "engine/pipeline/wide_photos.h"
#include "engine/sfm/registration.h"
#include "engine/sfm/sfm.h"

namespace litags {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

constexpr int64_t kMaxRegistrationFile = int64_t{64} << 20;

std::string KeptFolder(const ReconstructInput& input) { return input.work_dir + "/cameras"; }

// As ReadCameras tells it, by the first line.
bool IsBundlerFile(const std::string& path) {
  std::array<char, 64> start = {};
  std::ifstream file(path, std::ios::binary);
  file.read(start.data(), start.size());
  return IsBundler({start.data(), static_cast<size_t>(file.gcount())});
}

// Of the files that ReadCameras reads.
std::string FingerprintOfCameras(const std::string& path) {
  Fingerprint f;
  for (const char* name : {"", "/cameras.bin", "/images.bin", "/points3D.bin", "/cameras.txt",
                           "/images.txt", "/points3D.txt"}) {
    std::error_code ignored;
    if (!fs::is_regular_file(path + name, ignored)) continue;
    f.AddFileIfReadable(path + name, kMaxModelFileBytes);
  }
  if (IsBundlerFile(path)) f.AddFileIfReadable(BundlerListOf(path), kMaxModelFileBytes);
  return f.Text();
}

std::string FingerprintOfPhoto(const std::string& path) {
  Fingerprint f;
  f.AddFileIfReadable(path, ImageLimits().max_bytes);
  return f.Text();
}

std::string FingerprintOfMasks(const MaskPaths& masks) {
  Fingerprint f;
  for (const auto& [photo, path] : masks) {
    f.Add(photo.data(), photo.size());
    f.AddFileIfReadable(path, ImageLimits().max_bytes);
  }
  return f.Text();
}

// What the cameras were found from. Kept cameras of anything else are not used.
Json SourceOf(const ReconstructInput& input, const ReconstructOptions& options,
              const std::vector<std::string>& photos, const MaskPaths& masks) {
  Json fingerprints = Json::array();
  for (const std::string& photo : photos) {
    fingerprints.push_back({photo, FingerprintOfPhoto(input.images_dir + "/" + photo)});
  }
  // Not where they lie: a job's folder moves from lease to lease.
  Json source = {{"given", !input.cameras_path.empty()}, {"photos", fingerprints}};
  if (!input.cameras_path.empty()) {
    source["fingerprint"] = FingerprintOfCameras(input.cameras_path);
  } else if (options.seed != 0) {
    source["seed"] = options.seed;  // of COLMAP's random numbers
  }
  if (!masks.empty()) source["masks"] = FingerprintOfMasks(masks);
  return ParseJson(JsonText(source));  // as it will be read back
}

// Registration that COLMAP produced, next to the model in work_dir/cameras. Of the report's notes,
// those from `first_note` on are of it.
absl::Status SaveRegistration(const std::string& dir, const Json& source, const SparseModel& model,
                              const ReconstructReport& report, size_t first_note) {
  LITAGS_RETURN_IF_ERROR(MakeOwnFolder(dir));
  std::error_code ignored;  // writing reports what matters
  fs::remove(dir + "/registration.json", ignored);
  LITAGS_RETURN_IF_ERROR(WriteColmapModel(dir, model));
  const std::vector<std::string> notes(report.notes.begin() + static_cast<ptrdiff_t>(first_note),
                                       report.notes.end());
  const Json json = {{"dropped", report.dropped},
                     {"preparation", report.sfm_preparation},
                     {"notes", notes},
                     {"source", source}};
  // Last: its presence says that the folder is whole.
  return WriteFileAtomically(dir + "/registration.json", JsonText(json, 1));
}

// Nothing if the cameras in `dir` were found from something else than `source`. Their notes take
// the place of the report's from `first_note` on.
absl::StatusOr<std::optional<SparseModel>> LoadRegistration(const std::string& dir,
                                                            const Json& source, size_t first_note,
                                                            ReconstructReport* report) {
  LITAGS_ASSIGN_OR_RETURN(const std::string text,
                          ReadFile(dir + "/registration.json", "cameras", kMaxRegistrationFile));
  const Json json = ParseJson(text);
  if (!json.is_object() || !json.contains("dropped") || !json.contains("preparation") ||
      !json.contains("notes")) {
    return absl::DataLossError(absl::StrCat(dir, "/registration.json is damaged"));
  }
  if (json.value("source", Json()) != source) return std::nullopt;
  LITAGS_ASSIGN_OR_RETURN(SparseModel model, ReadColmapModel(dir, "cameras"));
  try {
    auto dropped = json["dropped"].get<std::vector<std::string>>();
    auto preparation = json["preparation"].get<std::string>();
    const auto notes = json["notes"].get<std::vector<std::string>>();
    report->notes.resize(first_note);
    report->notes.insert(report->notes.end(), notes.begin(), notes.end());
    report->dropped = std::move(dropped);
    report->sfm_preparation = std::move(preparation);
  } catch (const Json::exception& e) {
    return absl::DataLossError(absl::StrCat(dir, "/registration.json: ", e.what()));
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
  for (const SfmRung& rung : result.rungs) {
    for (const auto& [step, seconds] :
         {std::pair("prepare", rung.prepare_seconds), std::pair("features", rung.feature_seconds),
          std::pair("match", rung.match_seconds), std::pair("verify", rung.verify_seconds),
          std::pair("map", rung.map_seconds)}) {
      report->camera_seconds[step] += seconds;
    }
  }
}

// "cameras were found in 61 s: features 10 s, ..."
std::string DescribeSeconds(const SfmResult& result, const ReconstructReport& report) {
  const auto step = [](std::string* out, const auto& of) {
    absl::StrAppendFormat(out, "%s %.0f s", of.first, of.second);
  };
  return absl::StrFormat("cameras were found in %.0f s: ", result.seconds) +
         absl::StrJoin(report.camera_seconds, ", ", step);
}

// The folder of these photos alone: links to them, or copies, if others lie beside them.
absl::StatusOr<std::string> FolderOf(const ReconstructInput& input,
                                     const std::vector<std::string>& photos) {
  LITAGS_ASSIGN_OR_RETURN(const std::vector<std::string> all,
                          ListPhotos(input.images_dir, "images"));
  if (all == photos) return input.images_dir;
  const fs::path dir = fs::path(input.work_dir) / "photos";
  LITAGS_RETURN_IF_ERROR(MakeEmptyFolder(dir));
  for (const std::string& photo : photos) {
    LITAGS_RETURN_IF_ERROR(LinkInWorkDir(fs::path(input.images_dir) / photo, dir / photo));
  }
  return dir.string();
}

// Some exporters do not say which photos saw a point, and what is left is a cloud of any density
// that no photo is bound to. Of a model of many more photos than were sent, little may be left.
size_t CountTracked(const SparseModel& model) {
  return static_cast<size_t>(
      std::count_if(model.points.begin(), model.points.end(),
                    [](const SparsePoint& point) { return point.track_length() >= 2; }));
}

// Where tracks are known, what none of these photos saw is none of this scene.
void DropUnseenPoints(SparseModel* model, std::vector<std::string>* notes) {
  const size_t all = model->points.size();
  const size_t unseen =
      std::erase_if(model->points, [](const SparsePoint& point) { return point.track.empty(); });
  if (unseen == 0) return;
  notes->push_back(absl::StrCat(unseen, " of the ", all, " points that came with the cameras are ",
                                "not used: none of these photos is said to have seen them"));
}

// The model to read, where the cameras given are a folder with several.
void ResolveGivenCameras(ReconstructInput* input, ReconstructReport* report) {
  const std::string given = input->cameras_path;
  if (given.empty()) return;
  input->cameras_path = ResolveCameras(given);
  if (input->cameras_path == given) return;
  std::error_code ignored;
  const bool is_folder = fs::is_directory(input->cameras_path, ignored);
  report->notes.push_back(absl::StrCat("the cameras are those in ",
                                       fs::proximate(input->cameras_path, given, ignored).string(),
                                       is_folder ? ", the largest model of the folder" : ""));
}

// Cameras that an earlier run kept of the same `source`, if any. `damage`: why some cannot be used.
std::optional<SparseModel> KeptCameras(const ReconstructInput& input, const Json& source,
                                       size_t first_note, ReconstructReport* report,
                                       std::string* damage) {
  for (const std::string& dir : {SolvedFisheyes(input), KeptFolder(input)}) {
    std::error_code error;  // reading says what is wrong
    if (!fs::exists(dir + "/registration.json", error) && !error) continue;
    absl::StatusOr<std::optional<SparseModel>> found =
        LoadRegistration(dir, source, first_note, report);
    if (found.ok() && found->has_value()) return *std::move(found);
    if (!found.ok()) *damage = std::string(found.status().message());
  }
  return std::nullopt;
}

// What the steps of COLMAP share.
struct Solver {
  const Context& context;
  const ReconstructInput& input;
  std::string folder;  // of the photos
  SfmOptions options;

  std::function<void(const SfmProgress&)> Progress() const {
    return [this](const SfmProgress& p) { context.progress(Stage::kFindingCameras, Describe(p)); };
  }
  absl::StatusOr<SfmResult> Triangulate(const SparseModel& model) const {
    return TriangulatePoints(folder, model, input.work_dir, options, context.cancel, Progress());
  }
};

SfmOptions OptionsOf(const Context& context, const ReconstructInput& input, const MaskPaths& masks,
                     const std::string& colmap) {
  SfmOptions sfm;
  sfm.colmap = colmap;
  sfm.threads = context.options.threads;
  sfm.seed = context.options.seed & kMaxSfmSeed;
  sfm.min_registered = context.options.min_registered;
  sfm.step_timeout_seconds = input.colmap_step_seconds;
  sfm.on_line = context.on_line;
  sfm.masks = masks;
  sfm.rig_views = context.input.rig_views;
  return sfm;
}

// Of cameras that an earlier run found, perhaps for one that needed fewer: COLMAP would find the
// same again.
absl::Status CheckEnoughPlaced(const ReconstructReport& report, const SfmOptions& options) {
  constexpr size_t kNamesShown = 5;
  const int needed = NeededPhotos(report.photos, options);
  if (report.registered >= needed) return absl::OkStatus();
  std::vector<std::string> names = report.dropped;
  const size_t more = names.size() - std::min(names.size(), kNamesShown);
  names.resize(names.size() - more);
  if (more > 0) names.push_back(absl::StrCat(more, " more"));
  return TooFewRegistered(report.registered, report.photos, needed, "cameras of an earlier run",
                          absl::StrCat("without a place: ", absl::StrJoin(names, ", ")));
}

absl::StatusOr<SparseModel> SolveCameras(const Solver& solver) {
  const Context& context = solver.context;
  LITAGS_ASSIGN_OR_RETURN(SfmResult result,
                          FindCameras(solver.folder, solver.input.work_dir, solver.options,
                                      context.cancel, solver.Progress()));
  FillReport(result, context.report);
  if (context.on_line) context.on_line(DescribeSeconds(result, *context.report));
  if (context.input.rig_views.empty()) return std::move(result.model);
  // Those that only their rig placed have no points yet.
  LITAGS_ASSIGN_OR_RETURN(SfmResult again, solver.Triangulate(result.model));
  return std::move(again.model);
}

// The same cameras with new points.
absl::StatusOr<SparseModel> TriangulateGiven(const Solver& solver, SparseModel model) {
  ReconstructReport* const report = solver.context.report;
  const size_t given = std::exchange(model.points, {}).size();
  // The equations of points, too, are worse the further away the origin is.
  const std::array<double, 3> origin = LocalOrigin(model.views);
  TakeAsOrigin(origin, &model);
  LITAGS_ASSIGN_OR_RETURN(SfmResult result, solver.Triangulate(model));
  if (given > 0) {
    report->notes.push_back(absl::StrCat("few of the ", given,
                                         " points that came with the cameras say that two of ",
                                         "these photos saw them: points are triangulated instead"));
  }
  for (const std::string& note : result.notes) report->notes.push_back(note);
  TakeAsOrigin({-origin[0], -origin[1], -origin[2]}, &result.model);
  return std::move(result.model);
}

// Whether the photos and their cameras are why no point was triangulated.
bool HasNothingToTriangulate(const absl::Status& status) {
  const auto detail = GetErrorDetail(status);
  return detail && (detail->reason == "SFM_NO_POINTS" || detail->reason == "SFM_NO_PARALLAX");
}

absl::StatusOr<SparseModel> TakeGivenCameras(const Solver& solver,
                                             const std::vector<std::string>& photos) {
  ReconstructReport* const report = solver.context.report;
  LITAGS_ASSIGN_OR_RETURN(SparseModel model,
                          ReadGivenCameras(solver.input, photos, &report->notes));
  const size_t tracked = CountTracked(model);
  bool has_tracks = tracked > 0 && tracked >= std::min(model.points.size(),
                                                       kEnoughPointsPerView * model.views.size());
  if (!has_tracks) {
    absl::StatusOr<SparseModel> triangulated = TriangulateGiven(solver, model);
    has_tracks = tracked > 0 && HasNothingToTriangulate(triangulated.status());  // some at least
    if (has_tracks) {
      report->notes.push_back(absl::StrCat(
          "few of the ", model.points.size(), " points that came with the cameras say that two of ",
          "these photos saw them, and no others could be triangulated: these are used"));
    } else {
      LITAGS_RETURN_IF_ERROR(triangulated.status());
      model = *std::move(triangulated);
    }
  }
  if (has_tracks) DropUnseenPoints(&model, &report->notes);
  std::set<std::string> placed;
  for (const View& view : model.views) placed.insert(view.name);
  for (const std::string& photo : photos) {
    if (!placed.contains(photo)) report->dropped.push_back(photo);
  }
  // Notes of triangulation say it already.
  if (!report->dropped.empty() && has_tracks) {
    report->notes.push_back(absl::StrCat(report->dropped.size(), " of ", photos.size(),
                                         " photos have no camera and are left out, such as ",
                                         report->dropped[0]));
  }
  report->sfm_preparation = "given";
  return model;
}

}  // namespace

absl::StatusOr<SparseModel> ObtainCameras(const Context& context,
                                          const std::vector<std::string>& photos,
                                          const MaskPaths& masks, const std::string& colmap) {
  ReconstructInput input = context.input;
  ReconstructReport* const report = context.report;
  const size_t first_note = report->notes.size();
  ResolveGivenCameras(&input, report);
  report->photos = static_cast<int>(photos.size());
  const Json source = SourceOf(input, context.options, photos, masks);
  SfmOptions options = OptionsOf(context, input, masks, colmap);
  const bool solve = input.cameras_path.empty();
  std::string damage;
  if (auto kept = KeptCameras(input, source, first_note, report, &damage)) {
    if (solve) LITAGS_RETURN_IF_ERROR(CheckEnoughPlaced(*report, options));
    return *std::move(kept);
  }

  LITAGS_ASSIGN_OR_RETURN(std::string folder, FolderOf(input, photos));
  const Solver solver = {context, input, std::move(folder), std::move(options)};
  LITAGS_ASSIGN_OR_RETURN(const SparseModel model,
                          solve ? SolveCameras(solver) : TakeGivenCameras(solver, photos));
  const std::string dir =
      solve && HasWideFisheye(model) ? SolvedFisheyes(input) : KeptFolder(input);
  LITAGS_RETURN_IF_ERROR(SaveRegistration(dir, source, model, *report, first_note));
  // Read back, so that this run and a resumed one see the same digits.
  LITAGS_ASSIGN_OR_RETURN(std::optional<SparseModel> read_back,
                          LoadRegistration(dir, source, first_note, report));
  if (!read_back.has_value()) return absl::InternalError("cameras changed while they were kept");
  if (!damage.empty()) {
    report->notes.push_back(absl::StrCat("the cameras kept from an earlier run could not be used (",
                                         damage, "); they were found again"));
  }
  return *std::move(read_back);
}

std::string SolvedFisheyes(const ReconstructInput& input) {
  return input.work_dir + "/solved_fisheyes";
}

}  // namespace litags
