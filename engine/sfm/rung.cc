#include "engine/sfm/rung.h"

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <map>
#include <utility>

#include "absl/strings/str_cat.h"
#include "engine/core/check.h"
#include "engine/core/error.h"
#include "engine/io/colmap_io.h"
#include "engine/io/file_util.h"
#include "engine/sfm/colmap.h"
#include "engine/sfm/colmap_database.h"
#include "engine/sfm/photo_match.h"

namespace litags {
namespace {

namespace fs = std::filesystem;

constexpr int kFewFeatures =
    50;  // fewer cannot give the 15 matches to several photos that SfM needs

std::map<std::string, int> IndexByCopyName(const std::vector<PhotoFile>& photos) {
  std::map<std::string, int> index;
  for (size_t i = 0; i < photos.size(); ++i) index[photos[i].copy_name] = static_cast<int>(i);
  return index;
}

double SecondsSince(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

// Copies and their features; the steps that both kinds of rung share.
absl::Status PrepareAndExtract(const RungInput& in, Colmap& colmap, SfmRung& rung) {
  rung.preparation = PreparationName(in.preparation);
  const auto start = std::chrono::steady_clock::now();
  in.report("prepare", 0);
  LITAGS_RETURN_IF_ERROR(WriteCopies(in.images_dir, in.photos, in.preparation, colmap.images_dir(),
                                     colmap.masks_dir(), in.options.threads, in.cancel,
                                     [&](double f) { in.report("prepare", f); }));
  rung.prepare_seconds = SecondsSince(start);
  in.report("features", 0);
  LITAGS_ASSIGN_OR_RETURN(rung.feature_seconds,
                          colmap.ExtractFeatures(static_cast<int>(in.photos.size()),
                                                 [&](double f) { in.report("features", f); }));
  return absl::OkStatus();
}

absl::Status Match(const RungInput& in, Colmap& colmap, SfmRung& rung) {
  const auto start = std::chrono::steady_clock::now();
  in.report("match", 0);
  LITAGS_ASSIGN_OR_RETURN(const std::vector<NamePair> pairs,
                          MatchPhotos(colmap.database_path(), in.options, in.cancel,
                                      [&](double f) { in.report("match", f); }));
  rung.match_seconds = SecondsSince(start);
  in.report("verify", 0);
  LITAGS_ASSIGN_OR_RETURN(rung.verify_seconds,
                          colmap.Verify(pairs, [&](double f) { in.report("verify", f); }));
  return absl::OkStatus();
}

// Features and matched photos of every photo, from the database.
absl::StatusOr<std::vector<SfmPhoto>> ReadPhotoFacts(const RungInput& in, const Colmap& colmap) {
  std::vector<SfmPhoto> facts(in.photos.size());
  for (size_t i = 0; i < facts.size(); ++i) facts[i].name = in.photos[i].name;
  const std::map<std::string, int> index = IndexByCopyName(in.photos);
  LITAGS_ASSIGN_OR_RETURN(const auto images, ReadDatabaseImages(colmap.database_path()));
  std::map<int, int> photo_of_id;
  for (const DatabaseImage& image : images) {
    const auto found = index.find(image.name);
    if (found == index.end()) continue;
    photo_of_id[image.id] = found->second;
    facts[found->second].features = image.features;
  }
  LITAGS_ASSIGN_OR_RETURN(const auto pairs, ReadVerifiedPairs(colmap.database_path(), kMinInliers));
  for (const VerifiedPair& pair : pairs) {
    for (const int id : {pair.id1, pair.id2}) {
      const auto found = photo_of_id.find(id);
      if (found != photo_of_id.end()) ++facts[found->second].matched_photos;
    }
  }
  return facts;
}

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
  for (SparsePoint& point : model.points) {
    for (TrackElement& seen : point.track) {
      const Camera& copy = model.views[seen.view].camera;
      const PhotoFile& photo = photos[photo_of[seen.view]];
      seen.x *= static_cast<double>(photo.width) / copy.width;
      seen.y *= static_cast<double>(photo.height) / copy.height;
    }
  }
  // Numbered copies sort like their photos, so the views are in name order already.
  for (size_t i = 0; i < model.views.size(); ++i) {
    const PhotoFile& photo = photos[photo_of[i]];
    model.views[i] = {photo.name, model.views[i].camera.Scaled(photo.width, photo.height)};
  }
  return model;
}

// All models that the mapper wrote, the one to keep first: most views, then most points. The
// reprojection error is no guide: small wrong models have the smallest.
absl::StatusOr<std::vector<SparseModel>> ReadModels(const std::string& models_dir,
                                                    const std::vector<PhotoFile>& photos) {
  std::vector<SparseModel> models;
  for (int i = 0; fs::exists(absl::StrCat(models_dir, "/", i)); ++i) {
    LITAGS_ASSIGN_OR_RETURN(SparseModel copies,
                            ReadColmapModel(absl::StrCat(models_dir, "/", i), "colmap model"));
    LITAGS_ASSIGN_OR_RETURN(SparseModel model, ToPhotos(std::move(copies), photos));
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
    photo.reason = absl::StrCat("belongs to a separate group of ", group_sizes[group], " photos");
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

// The model that point_triangulator starts from. COLMAP finds photos by image id, and our writer
// numbers views from 1 in their order: so they are put in the order of the database's ids.
absl::StatusOr<SparseModel> InDatabaseOrder(const RungInput& in, const SparseModel& cameras,
                                            const std::vector<DatabaseImage>& images) {
  const std::map<std::string, int> index = IndexByCopyName(in.photos);
  SparseModel model;
  for (size_t i = 0; i < images.size(); ++i) {
    const auto found = index.find(images[i].name);
    if (found == index.end() || images[i].id != static_cast<int>(i) + 1) break;
    const PhotoFile& photo = in.photos[found->second];
    model.views.push_back({photo.copy_name, cameras.views[found->second].camera.Scaled(
                                                photo.copy_width, photo.copy_height)});
    model.distortions.push_back(cameras.distortions[found->second]);
  }
  if (model.views.size() == in.photos.size()) return model;
  return MakeError(absl::StatusCode::kInternal, "COLMAP_DATABASE", "",
                   absl::StrCat("COLMAP read ", images.size(), " of ", in.photos.size(),
                                " prepared photos; see feature_extractor.log"));
}

}  // namespace

absl::StatusOr<RungOutput> MapPhotos(const RungInput& in) {
  const std::string models_dir = in.dir + "/models";
  LITAGS_RETURN_IF_ERROR(MakeFolder(models_dir));
  Colmap colmap(in.options, in.dir, in.cancel);
  RungOutput out;
  LITAGS_RETURN_IF_ERROR(PrepareAndExtract(in, colmap, out.rung));
  LITAGS_RETURN_IF_ERROR(Match(in, colmap, out.rung));
  in.report("map", 0);
  LITAGS_ASSIGN_OR_RETURN(out.rung.map_seconds,
                          colmap.Map(models_dir, static_cast<int>(in.photos.size()),
                                     [&](double f) { in.report("map", f); }));

  LITAGS_ASSIGN_OR_RETURN(std::vector<SparseModel> models, ReadModels(models_dir, in.photos));
  LITAGS_ASSIGN_OR_RETURN(out.photos, ReadPhotoFacts(in, colmap));
  const std::map<std::string, int> group_of = GroupPhotos(models, out.rung.groups);
  for (SfmPhoto& photo : out.photos) {
    const auto found = group_of.find(photo.name);
    ExplainDrop(photo, found == group_of.end() ? -1 : found->second, out.rung.groups);
  }
  if (!models.empty()) out.model = std::move(models[0]);
  out.rung.registered = static_cast<int>(out.model.views.size());
  out.rung.points = static_cast<int64_t>(out.model.points.size());
  return out;
}

absl::StatusOr<RungOutput> TriangulatePhotos(const RungInput& in, const SparseModel& cameras) {
  LITAGS_CHECK(cameras.views.size() == in.photos.size());
  const std::string input_dir = in.dir + "/known", output_dir = in.dir + "/triangulated";
  LITAGS_RETURN_IF_ERROR(MakeFolder(input_dir));
  LITAGS_RETURN_IF_ERROR(MakeFolder(output_dir));
  Colmap colmap(in.options, in.dir, in.cancel);
  RungOutput out;
  LITAGS_RETURN_IF_ERROR(PrepareAndExtract(in, colmap, out.rung));
  LITAGS_ASSIGN_OR_RETURN(const auto images, ReadDatabaseImages(colmap.database_path()));
  LITAGS_ASSIGN_OR_RETURN(const SparseModel known, InDatabaseOrder(in, cameras, images));
  LITAGS_RETURN_IF_ERROR(SetKnownCameras(colmap.database_path(), known));
  LITAGS_RETURN_IF_ERROR(WriteColmapModel(input_dir, known));
  LITAGS_RETURN_IF_ERROR(Match(in, colmap, out.rung));
  in.report("triangulate", 0);
  LITAGS_ASSIGN_OR_RETURN(
      out.rung.map_seconds,
      colmap.Triangulate(input_dir, output_dir, static_cast<int>(in.photos.size()),
                         [&](double f) { in.report("triangulate", f); }));

  std::error_code ignored;                   // the reader says what is wrong
  if (!fs::is_empty(output_dir, ignored)) {  // else there are no points
    LITAGS_ASSIGN_OR_RETURN(SparseModel copies, ReadColmapModel(output_dir, "colmap model"));
    LITAGS_ASSIGN_OR_RETURN(out.model, ToPhotos(std::move(copies), in.photos));
    if (out.model.views.size() != cameras.views.size()) {
      return MakeError(absl::StatusCode::kInternal, "COLMAP_FAILED", "point_triangulator",
                       absl::StrCat("COLMAP returned ", out.model.views.size(), " of ",
                                    cameras.views.size(), " given cameras"));
    }
  }
  // The given numbers, not what they became on the way through COLMAP.
  out.model.views = cameras.views;
  out.model.distortions = cameras.distortions;
  LITAGS_ASSIGN_OR_RETURN(out.photos, ReadPhotoFacts(in, colmap));
  out.rung.registered = static_cast<int>(out.model.views.size());
  out.rung.points = static_cast<int64_t>(out.model.points.size());
  out.rung.groups = {out.rung.registered};
  return out;
}

}  // namespace litags
