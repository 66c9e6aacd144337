// A rung for known cameras: COLMAP finds the features, the points are ours.
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "engine/core/check.h"
#include "engine/core/error.h"
#include "engine/core/monotonic_seconds.h"
#include "engine/sfm/colmap.h"
#include "engine/sfm/colmap_database.h"
#include "engine/sfm/colmap_keypoints.h"
#include "engine/sfm/photo_match.h"
#include "engine/sfm/point_colors.h"
#include "engine/sfm/rung.h"
#include "engine/sfm/rung_steps.h"
#include "engine/sfm/triangulate.h"

namespace litags {
namespace {

using Keypoints =
    std::vector<std::vector<Eigen::Vector2d>>;  // [photos][features], px of the copies

absl::Status CheckImages(const RungInput& in, const std::vector<DatabaseImage>& images) {
  bool all = images.size() == in.photos.size();
  for (size_t i = 0; all && i < images.size(); ++i) all = images[i].name == in.photos[i].copy_name;
  if (all) return absl::OkStatus();
  return MakeError(absl::StatusCode::kInternal, "COLMAP_DATABASE", "",
                   absl::StrCat("COLMAP read ", images.size(), " of ", in.photos.size(),
                                " prepared photos; see feature_extractor.log"));
}

// The given cameras at the size of the copies.
SparseModel CamerasOfCopies(const RungInput& in, const SparseModel& cameras) {
  SparseModel copies;
  for (size_t i = 0; i < in.photos.size(); ++i) {
    const PhotoFile& photo = in.photos[i];
    copies.views.push_back({photo.copy_name, CameraOfCopy(cameras.views[i].camera, photo)});
  }
  copies.distortions = cameras.distortions;
  return copies;
}

// Images are numbered from 1 in the order of the photos.
std::vector<PhotoMatches> ByPhoto(std::vector<ImageMatches> matches) {
  std::vector<PhotoMatches> by_photo;
  for (ImageMatches& pair : matches) {
    by_photo.push_back({pair.id1 - 1, pair.id2 - 1, std::move(pair.matches)});
  }
  return by_photo;
}

std::vector<VerifiedPair> Summaries(const std::vector<VerifiedPhotoPair>& pairs) {
  std::vector<VerifiedPair> summaries;
  for (const VerifiedPhotoPair& pair : pairs) {
    summaries.push_back({.id1 = pair.photo1 + 1, .id2 = pair.photo2 + 1});
  }
  return summaries;
}

SparsePoint ToSparsePoint(const TriangulatedPoint& point, const Keypoints& keypoints) {
  SparsePoint out;
  out.xyz = {point.xyz.x(), point.xyz.y(), point.xyz.z()};
  out.error = point.error;
  for (const Observation& o : point.track) {
    const Eigen::Vector2d& seen = keypoints[o.photo][o.feature];
    out.track.push_back({o.photo, seen.x(), seen.y()});
  }
  return out;
}

// Colours the points and brings their tracks to the size of the photos.
absl::Status Finish(const RungInput& in, const Colmap& colmap, SparseModel& copies) {
  std::vector<std::string> paths;
  std::vector<int> photo_of;
  for (size_t i = 0; i < in.photos.size(); ++i) {
    paths.push_back(absl::StrCat(colmap.images_dir(), "/", in.photos[i].copy_name));
    photo_of.push_back(static_cast<int>(i));
  }
  LITAGS_RETURN_IF_ERROR(ColorPoints(paths, in.options.threads, in.cancel, copies.points));
  ScaleTracks(in.photos, photo_of, copies);
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<RungOutput> TriangulatePhotos(const RungInput& in, const SparseModel& cameras) {
  LITAGS_CHECK(cameras.views.size() == in.photos.size());
  Colmap colmap(in.options, in.dir, in.cancel);
  RungOutput out;
  LITAGS_RETURN_IF_ERROR(PrepareAndExtract(in, colmap, out.rung));
  LITAGS_ASSIGN_OR_RETURN(const auto images, ReadDatabaseImages(colmap.database_path()));
  LITAGS_RETURN_IF_ERROR(CheckImages(in, images));
  LITAGS_ASSIGN_OR_RETURN(const Keypoints keypoints, ReadKeypoints(colmap.database_path(), images));

  double start = MonotonicSeconds();
  in.report("match", 0);
  LITAGS_ASSIGN_OR_RETURN(auto matches, ComparePhotos(colmap.database_path(), in.options, in.cancel,
                                                      [&](double f) { in.report("match", f); }));
  out.rung.match_seconds = MonotonicSeconds() - start;

  start = MonotonicSeconds();
  in.report("triangulate", 0);
  SparseModel copies = CamerasOfCopies(in, cameras);
  std::vector<PhotoRays> posed;
  for (size_t i = 0; i < copies.views.size(); ++i) {
    posed.emplace_back(copies.views[i].camera, copies.distortions[i], keypoints[i]);
  }
  const int threads = in.options.threads;
  const auto pairs = VerifyPairs(posed, ByPhoto(std::move(matches)), threads);
  LITAGS_ASSIGN_OR_RETURN(const auto points, TriangulatePairs(posed, pairs, threads, in.cancel));
  for (const TriangulatedPoint& point : points) {
    copies.points.push_back(ToSparsePoint(point, keypoints));
  }
  LITAGS_RETURN_IF_ERROR(Finish(in, colmap, copies));
  out.rung.map_seconds = MonotonicSeconds() - start;

  out.model = cameras;  // the given numbers
  out.model.points = std::move(copies.points);
  LITAGS_ASSIGN_OR_RETURN(out.photos, PhotoFacts(in, images, Summaries(pairs)));
  out.rung.registered = static_cast<int>(out.model.views.size());
  out.rung.points = static_cast<int64_t>(out.model.points.size());
  out.rung.groups = {out.rung.registered};
  return out;
}

}  // namespace litags
