#include "engine/sfm/rung.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "engine/core/counted.h"
#include "engine/core/error.h"
#include "engine/core/monotonic_seconds.h"
#include "engine/core/spread_indices.h"
#include "engine/io/colmap_io.h"
#include "engine/io/file_util.h"
#include "engine/io/work_folder.h"
#include "engine/sfm/colmap.h"
#include "engine/sfm/colmap_database.h"
#include "engine/sfm/colmap_keypoints.h"
#include "engine/sfm/photo_match.h"
#include "engine/sfm/rigs.h"
#include "engine/sfm/rung_steps.h"
#include "engine/sfm/turning.h"

namespace litags {
namespace {

namespace fs = std::filesystem;

constexpr int kFewFeatures =
    50;  // fewer cannot give the 15 matches to several photos that SfM needs

// What verified pairs and the mapper make of the matches.
struct Mapping {
  std::vector<SparseModel> models;  // the one to keep first
  std::vector<VerifiedPair> pairs;
  bool turned = false;

  size_t placed() const { return models.empty() ? 0 : models[0].views.size(); }
  // Of points by photos.
  int64_t sightings() const {
    int64_t sum = 0;
    if (models.empty()) return sum;
    for (const SparsePoint& point : models[0].points) sum += point.track_length();
    return sum;
  }
  // Mean over those, px.
  double error() const {
    double sum = 0;
    if (models.empty()) return sum;
    for (const SparsePoint& point : models[0].points) sum += point.error * point.track_length();
    return sum / static_cast<double>(std::max<int64_t>(sightings(), 1));
  }
};

// The photo of each view of a model of copies. The model's reader drops folders from names.
absl::StatusOr<std::vector<int>> PhotoOfViews(const SparseModel& copies,
                                              const std::vector<PhotoFile>& photos) {
  std::map<std::string, int> index;
  for (size_t i = 0; i < photos.size(); ++i) {
    index[BaseName(photos[i].copy_name)] = static_cast<int>(i);
  }
  std::vector<int> photo_of;
  for (const View& view : copies.views) {
    const auto found = index.find(view.name);
    if (found == index.end()) {
      return MakeError(absl::StatusCode::kInternal, "COLMAP_FAILED", "images",
                       absl::StrCat("COLMAP's model holds \"", view.name,
                                    "\", which is none of the prepared photos"));
    }
    photo_of.push_back(found->second);
  }
  return photo_of;
}

// Turns a model of copies into one of their photos: names, sizes, positions in tracks.
absl::StatusOr<SparseModel> ToPhotos(SparseModel model, const std::vector<PhotoFile>& photos) {
  LITAGS_ASSIGN_OR_RETURN(const std::vector<int> photo_of, PhotoOfViews(model, photos));
  ScaleTracks(photos, photo_of, model);
  model.paths.clear();  // of the copies
  // Numbered copies sort like their photos, so the views are in name order already.
  for (size_t i = 0; i < model.views.size(); ++i) {
    const PhotoFile& photo = photos[photo_of[i]];
    model.views[i] = {photo.name, CameraOfPhoto(model.views[i].camera, photo)};
  }
  return model;
}

// All models that the mapper wrote, the one to keep first: most views, then most points. The
// reprojection error is no guide: small wrong models have the smallest.
absl::StatusOr<std::vector<SparseModel>> ReadModels(const std::string& models_dir,
                                                    const std::vector<PhotoFile>& photos,
                                                    const RigViews& rigs) {
  std::vector<SparseModel> models;
  std::error_code ignored;
  for (int i = 0; fs::exists(absl::StrCat(models_dir, "/", i), ignored); ++i) {
    LITAGS_ASSIGN_OR_RETURN(SparseModel copies,
                            ReadColmapModel(absl::StrCat(models_dir, "/", i), "colmap model"));
    LITAGS_ASSIGN_OR_RETURN(SparseModel model, ToPhotos(std::move(copies), photos));
    PlaceRigViews(rigs, photos, &model);
    models.push_back(std::move(model));
  }
  std::stable_sort(models.begin(), models.end(), [](const SparseModel& a, const SparseModel& b) {
    return std::pair(a.views.size(), a.points.size()) > std::pair(b.views.size(), b.points.size());
  });
  return models;
}

// Group of each photo, by name: 0 for the kept model, then those in no earlier one.
std::map<std::string, int> GroupPhotos(const std::vector<SparseModel>& models,
                                       std::vector<int>& group_sizes) {
  std::map<std::string, int> group_of;
  for (const SparseModel& model : models) {
    const int group = static_cast<int>(group_sizes.size());
    int size = 0;
    for (const View& view : model.views) size += group_of.emplace(view.name, group).second;
    if (size > 0) group_sizes.push_back(size);
  }
  return group_of;
}

void ExplainDrop(SfmPhoto& photo, int group, const std::vector<int>& group_sizes) {
  if (group == 0) return;
  if (group > 0) {
    photo.drop = DropCause::kOtherGroup;
    photo.reason =
        absl::StrCat("belongs to a separate group of ", Counted(group_sizes[group], "photo"));
  } else if (photo.features < kFewFeatures) {
    photo.drop = DropCause::kFewFeatures;
    photo.reason = absl::StrCat("has only ", photo.features,
                                " features: blurred, without detail, or too dark or bright");
  } else if (photo.matched_photos == 0) {
    photo.drop = DropCause::kNoMatches;
    photo.reason = "matches no other photo: another place, or too little overlap";
  } else {
    photo.drop = DropCause::kNotPlaced;
    photo.reason = absl::StrCat("matches ", photo.matched_photos,
                                " photos, but with too few common points to place it");
  }
}

// Where a photo shows a feature, px of its copy from the middle.
Eigen::Vector2d FromMiddle(const PhotoFile& photo, const Eigen::Vector2d& keypoint) {
  return keypoint - Eigen::Vector2d(photo.copy_width, photo.copy_height) / 2;
}

// Whether the photos show no parallax. Images are numbered from 1 in the order of the photos.
absl::StatusOr<bool> CameraTurned(const RungInput& in, const std::string& database,
                                  const std::vector<DatabaseImage>& images,
                                  const std::vector<VerifiedPair>& pairs) {
  // That are looked at: medians over more say the same. Choice
  constexpr size_t kMostPairs = 200;
  // COLMAP calls nearly all pairs of a camera that turns flat, 60 % of those of a good walk. Choice
  constexpr double kFlat = 0.95;
  const auto flat =
      std::count_if(pairs.begin(), pairs.end(), [](const VerifiedPair& p) { return p.flat; });
  const double all = static_cast<double>(pairs.size());
  if (pairs.empty() || static_cast<double>(flat) < kFlat * all) return false;
  LITAGS_ASSIGN_OR_RETURN(const auto matches, ReadVerifiedMatches(database));
  LITAGS_ASSIGN_OR_RETURN(const auto keypoints, ReadKeypoints(database, images));
  int longer_side = 0;
  for (const PhotoFile& photo : in.photos) {
    longer_side = std::max({longer_side, photo.copy_width, photo.copy_height});
  }
  std::vector<SeenTwice> seen;
  for (const size_t i : SpreadIndices(matches.size(), kMostPairs)) {
    const int first = matches[i].id1 - 1, second = matches[i].id2 - 1;
    SeenTwice& both = seen.emplace_back();
    for (const FeatureMatch& match : matches[i].matches) {
      both.first.push_back(FromMiddle(in.photos[first], keypoints[first][match.index1]));
      both.second.push_back(FromMiddle(in.photos[second], keypoints[second][match.index2]));
    }
  }
  return TurnedInPlace(seen, longer_side, in.cancel);
}

absl::StatusOr<Mapping> VerifyAndMap(const RungInput& in, const std::vector<NamePair>& pairs,
                                     const char* models, Colmap& colmap, SfmRung& rung) {
  const std::string models_dir = absl::StrCat(in.dir, "/", models);
  LITAGS_RETURN_IF_ERROR(MakeFolder(models_dir));
  in.report("verify", 0);
  LITAGS_ASSIGN_OR_RETURN(const double verify_seconds,
                          colmap.Verify(pairs, [&](double f) { in.report("verify", f); }));
  in.report("map", 0);
  LITAGS_ASSIGN_OR_RETURN(
      const double map_seconds,
      colmap.Map(models_dir, in.photos, [&](double f) { in.report("map", f); }));
  rung.verify_seconds += verify_seconds;
  rung.map_seconds += map_seconds;
  Mapping mapping;
  LITAGS_ASSIGN_OR_RETURN(mapping.models, ReadModels(models_dir, in.photos, in.options.rig_views));
  LITAGS_ASSIGN_OR_RETURN(const auto images, ReadDatabaseImages(colmap.database_path()));
  LITAGS_ASSIGN_OR_RETURN(mapping.pairs, ReadVerifiedPairs(colmap.database_path()));
  LITAGS_ASSIGN_OR_RETURN(mapping.turned,
                          CameraTurned(in, colmap.database_path(), images, mapping.pairs));
  return mapping;
}

// Focal lengths of copies to start from instead of COLMAP's guess.
struct Start {
  std::string source;
  FocalLengths focal_lengths;
};

// By how much focal lengths may differ to be the same: EXIF rounds to mm, of the diagonal or the
// width. Choice
constexpr double kAgree = 1.15;

bool Agree(double a, double b) { return a < kAgree * b && b < kAgree * a; }

// EXIF's, unless the photos are all placed with such ones; without EXIF those of the photos that
// were placed, unless these are all or agree with the guess: from a guess that is far off COLMAP
// makes many small models of a long walk.
std::optional<Start> SecondStart(const RungInput& in, const Mapping& mapping) {
  constexpr double kGuess = 1.2;  // of the longer side: COLMAP's default_focal_length_factor
  std::map<std::string, double> found;
  if (!mapping.models.empty()) {
    for (const View& view : mapping.models[0].views) found[view.name] = view.camera.fx;
  }
  Start exif{"that EXIF says", {}}, own{"of the photos that were placed", {}};
  bool exif_differs = false, own_differs = false;
  for (const PhotoFile& photo : in.photos) {
    const auto view = found.find(photo.name);
    const double own_focal_length =
        view == found.end() ? 0 : view->second * photo.copy_width / photo.shown.width;
    if (own_focal_length > 0) {
      own.focal_lengths.emplace_back(photo.copy_name, own_focal_length);
      own_differs |=
          !Agree(own_focal_length, kGuess * std::max(photo.copy_width, photo.copy_height));
    }
    if (photo.copy_exif_focal_length > 0) {
      exif.focal_lengths.emplace_back(photo.copy_name, photo.copy_exif_focal_length);
      exif_differs |=
          own_focal_length > 0 && !Agree(own_focal_length, photo.copy_exif_focal_length);
    }
  }
  const double enough = in.options.enough_registered * static_cast<double>(in.photos.size());
  const bool missing = static_cast<double>(mapping.placed()) < enough - 1e-9;
  if (!exif.focal_lengths.empty()) {
    return missing || exif_differs ? std::optional(exif) : std::nullopt;
  }
  return missing && own_differs ? std::optional(own) : std::nullopt;
}

// More photos; else as many, in whatever way one looks at it: a model with a wrong focal length may
// have more points in shorter tracks, or as many that fit worse.
bool IsBetter(const Mapping& a, const Mapping& b) {
  if (a.placed() != b.placed()) return a.placed() > b.placed();
  return a.sightings() > b.sightings() && a.error() <= b.error();
}

// Maps again from what the database has now. Null if that is not better.
absl::StatusOr<std::optional<Mapping>> MapAgain(const RungInput& in,
                                                const std::vector<NamePair>& pairs,
                                                const char* models, const Mapping& mapping,
                                                Colmap& colmap, SfmRung& rung) {
  LITAGS_RETURN_IF_ERROR(ForgetVerifiedPairs(colmap.database_path()));
  LITAGS_ASSIGN_OR_RETURN(Mapping other, VerifyAndMap(in, pairs, models, colmap, rung));
  if (!IsBetter(other, mapping)) return std::nullopt;
  return other;
}

absl::Status TryStart(const RungInput& in, const std::vector<NamePair>& pairs, const Start& start,
                      Colmap& colmap, RungOutput& out, Mapping& mapping) {
  LITAGS_RETURN_IF_ERROR(SetFocalLengths(colmap.database_path(), start.focal_lengths));
  LITAGS_ASSIGN_OR_RETURN(std::optional<Mapping> other,
                          MapAgain(in, pairs, "models_again", mapping, colmap, out.rung));
  if (!other.has_value()) return absl::OkStatus();
  out.notes.push_back(
      absl::StrCat("the focal length ", start.source, " was the start: ", other->placed(),
                   " photos were placed, which see points ", other->sightings(),
                   " times; without it ", mapping.placed(), ", and ", mapping.sightings()));
  mapping = *std::move(other);
  return absl::OkStatus();
}

// How much nearer to the middle than without distortion a lens shows the corners of a photo, to
// first order.
double DrawnIn(const Camera& camera, const Distortion& lens) {
  const double x = 0.5 * camera.width / camera.fx, y = 0.5 * camera.height / camera.fy;
  return -lens.k1 * (x * x + y * y);
}

// Focal lengths of copies whose lens may be a fisheye. Handbooks give plain lenses up to 5 % of
// distortion; an equidistant fisheye of 60 degrees from corner to corner has 9 %, one of 90
// degrees 21 %.
FocalLengths LikelyFisheyes(const RungInput& in, const Mapping& mapping) {
  constexpr double kFisheye = 0.1;
  FocalLengths likely;
  if (mapping.models.empty()) return likely;
  const SparseModel& model = mapping.models[0];
  std::map<std::string, size_t> view_of;
  for (size_t i = 0; i < model.views.size(); ++i) view_of[model.views[i].name] = i;
  for (const PhotoFile& photo : in.photos) {
    const auto view = view_of.find(photo.name);
    if (view == view_of.end() || photo.copy_focal_length > 0) continue;
    const Camera& camera = model.views[view->second].camera;
    if (DrawnIn(camera, model.distortions[view->second]) < kFisheye) continue;
    likely.emplace_back(photo.copy_name, camera.fx * photo.copy_width / photo.shown.width);
  }
  return likely;
}

absl::Status TryFisheyes(const RungInput& in, const std::vector<NamePair>& pairs,
                         const FocalLengths& likely, Colmap& colmap, RungOutput& out,
                         Mapping& mapping) {
  LITAGS_RETURN_IF_ERROR(SetFisheyes(colmap.database_path(), likely));
  LITAGS_ASSIGN_OR_RETURN(std::optional<Mapping> other,
                          MapAgain(in, pairs, "models_fisheye", mapping, colmap, out.rung));
  if (!other.has_value()) return absl::OkStatus();
  out.notes.push_back(absl::StrFormat(
      "the lens is a fisheye: %d photos were placed, which see points within %.2f px; as those of "
      "a plain lens %d, and within %.2f px",
      other->placed(), other->error(), mapping.placed(), mapping.error()));
  mapping = *std::move(other);
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<RungOutput> MapPhotos(const RungInput& in) {
  Colmap colmap(in.options, in.dir, in.cancel);
  RungOutput out;
  LITAGS_RETURN_IF_ERROR(PrepareAndExtract(in, colmap, out.rung));
  const double start = MonotonicSeconds();
  in.report("match", 0);
  LITAGS_ASSIGN_OR_RETURN(const std::vector<NamePair> pairs,
                          MatchPhotos(colmap.database_path(), in.options, in.cancel,
                                      [&](double f) { in.report("match", f); }));
  out.rung.match_seconds = MonotonicSeconds() - start;
  LITAGS_ASSIGN_OR_RETURN(Mapping mapping, VerifyAndMap(in, pairs, "models", colmap, out.rung));
  if (const std::optional<Start> start = SecondStart(in, mapping)) {
    LITAGS_RETURN_IF_ERROR(TryStart(in, pairs, *start, colmap, out, mapping));
  }
  if (const FocalLengths likely = LikelyFisheyes(in, mapping); !likely.empty()) {
    LITAGS_RETURN_IF_ERROR(TryFisheyes(in, pairs, likely, colmap, out, mapping));
  }
  LITAGS_ASSIGN_OR_RETURN(const auto images, ReadDatabaseImages(colmap.database_path()));
  LITAGS_ASSIGN_OR_RETURN(out.photos, PhotoFacts(in, images, mapping.pairs));
  const std::map<std::string, int> group_of = GroupPhotos(mapping.models, out.rung.groups);
  for (SfmPhoto& photo : out.photos) {
    const auto found = group_of.find(photo.name);
    ExplainDrop(photo, found == group_of.end() ? -1 : found->second, out.rung.groups);
  }
  out.rung.turned = mapping.turned;
  if (!mapping.models.empty()) out.model = std::move(mapping.models[0]);
  out.rung.registered = static_cast<int>(out.model.views.size());
  out.rung.points = static_cast<int64_t>(out.model.points.size());
  return out;
}

}  // namespace litags
