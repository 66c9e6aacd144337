#include "engine/pipeline/dense_start.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/core/mask.h"
#include "engine/io/container.h"
#include "engine/pipeline/depth_maps.h"
#include "engine/stereo/stereo.h"

namespace litags {
namespace {

constexpr char kKind[] = "start points";
constexpr uint32_t kVersion = 1;

// The photo's pixel under the centre of the map's.
std::pair<int, int> PixelUnder(const PhotoDepth& photo, int x, int y) {
  const Camera& camera = photo.photo->view->camera;
  const Planes& depth = photo.map->depth;
  return {static_cast<int>((x + 0.5) * camera.width / depth.width),
          static_cast<int>((y + 0.5) * camera.height / depth.height)};
}

bool IsMasked(const PosedPhoto& photo, int x, int y) {
  return photo.mask != nullptr && !Counts(*photo.mask, x, y);
}

// Calls visit(photo, x, y) for the known pixels of a grid of the map's, `step` apart.
template <class Visit>
void ForEachKnown(absl::Span<const PhotoDepth> photos, int step, const Visit& visit) {
  for (const PhotoDepth& photo : photos) {
    const Planes& confidence = photo.map->confidence;
    for (int y = step / 2; y < confidence.height; y += step) {
      for (int x = step / 2; x < confidence.width; x += step) {
        if (confidence.at(0, y, x) < kDenseConfidence) continue;
        const auto [u, v] = PixelUnder(photo, x, y);
        if (!IsMasked(*photo.photo, u, v)) visit(photo, x, y);
      }
    }
  }
}

SparsePoint PointAt(const PhotoDepth& photo, int x, int y) {
  const Camera camera =
      photo.photo->view->camera.Scaled(photo.map->depth.width, photo.map->depth.height);
  SparsePoint point;
  point.xyz = camera.WorldFromCam(camera.Unproject(x + 0.5, y + 0.5, photo.map->depth.at(0, y, x)));
  const auto [u, v] = PixelUnder(photo, x, y);
  const int16_t* pixel = photo.photo->target->pixel(u, v);
  for (int c = 0; c < 3; ++c) {
    point.rgb[c] = static_cast<uint8_t>(std::clamp(std::lround(pixel[c] / kPhotoCode), 0L, 255L));
  }
  return point;
}

absl::Status Keep(const std::string& path, const std::string& key,
                  absl::Span<const SparsePoint> points) {
  std::vector<double> xyz;
  std::vector<uint8_t> rgb;
  for (const SparsePoint& point : points) {
    xyz.insert(xyz.end(), point.xyz.begin(), point.xyz.end());
    rgb.insert(rgb.end(), point.rgb.begin(), point.rgb.end());
  }
  ContainerWriter writer(kKind, kVersion);
  writer.AddSectionView("key", key);
  writer.AddArrayView("xyz", xyz);
  writer.AddArrayView("rgb", rgb);
  return writer.Commit(path);
}

// The kept points; nothing if there are none, or they are damaged, of something else or of another
// version: they can always be made again.
std::optional<std::vector<SparsePoint>> Kept(const std::string& path, const std::string& key) {
  const auto file = Container::Read(path, kKind, kVersion, kVersion);
  if (!file.ok()) return std::nullopt;
  const auto kept_key = file->Section("key");
  const auto xyz = file->Array<double>("xyz");
  const auto rgb = file->Array<uint8_t>("rgb");
  if (!kept_key.ok() || *kept_key != key || !xyz.ok() || !rgb.ok()) return std::nullopt;
  if (xyz->size() != rgb->size() || xyz->size() % 3 != 0) return std::nullopt;
  std::vector<SparsePoint> points(xyz->size() / 3);
  for (size_t i = 0; i < points.size(); ++i) {
    std::copy_n(xyz->begin() + 3 * i, 3, points[i].xyz.begin());
    std::copy_n(rgb->begin() + 3 * i, 3, points[i].rgb.begin());
  }
  return points;
}

std::vector<SparsePoint> PointsOfMaps(const std::vector<PosedPhoto>& photos, const DepthMaps& maps,
                                      int64_t limit) {
  std::vector<PhotoDepth> known;
  for (size_t i = 0; i < maps.size(); ++i) {
    if (maps[i].has_value()) known.push_back({&photos[i], &*maps[i]});
  }
  return PointsOfDepth(known, limit);
}

absl::StatusOr<DepthMaps> StereoOfFew(const Context& context, const std::vector<PosedPhoto>& photos,
                                      absl::Span<const SparsePoint> points,
                                      absl::Span<const int> point_views) {
  std::vector<PosedPhoto> undistorted;
  for (const PosedPhoto& p : photos) undistorted.push_back({p.view, p.photo, p.target});
  StereoOptions stereo;
  stereo.threads = context.options.threads;
  const auto report = [&](int done, int total) {
    context.progress(Stage::kPreparing, absl::StrCat("points to start from by stereo: ", done,
                                                     " of ", total, " photos"));
  };
  return StereoDepth(undistorted, PointsOfFew(points, point_views, context.recipe.stereo_photos),
                     stereo, context.cancel, report);
}

}  // namespace

std::vector<SparsePoint> PointsOfDepth(absl::Span<const PhotoDepth> photos, int64_t limit) {
  std::vector<SparsePoint> points;
  if (limit <= 0) return points;
  const auto count = [&](int step) {
    int64_t known = 0;
    ForEachKnown(photos, step, [&](const PhotoDepth&, int, int) { ++known; });
    return known;
  };
  int step = std::max(1, static_cast<int>(std::sqrt(static_cast<double>(count(1)) / limit)));
  while (count(step) > limit) ++step;
  ForEachKnown(photos, step, [&](const PhotoDepth& photo, int x, int y) {
    points.push_back(PointAt(photo, x, y));
  });
  return points;
}

absl::StatusOr<std::vector<SparsePoint>> DenseStartPoints(const Context& context,
                                                          const std::vector<PosedPhoto>& photos,
                                                          const DepthMaps& depth,
                                                          absl::Span<const SparsePoint> points,
                                                          absl::Span<const int> point_views,
                                                          const std::string& key) {
  std::vector<SparsePoint> dense;
  const int64_t sparse = static_cast<int64_t>(points.size());
  const int64_t limit = context.options.max_gaussians / 16 - sparse;
  if (!context.recipe.dense_start || limit <= 0) return dense;
  const std::string path = context.input.work_dir + "/start.litags";
  const bool has_stereo = ResolveDepthOrigin(context) == DepthOrigin::kStereo;
  const int of_photos =
      has_stereo ? StereoPhotos(context.recipe, context.options) : context.recipe.stereo_photos;
  const std::string full_key =
      absl::StrCat("at most ", limit, has_stereo ? " of the loss's depth of " : " of stereo of ",
                   of_photos, " photos, ", key);
  if (std::optional<std::vector<SparsePoint>> kept = Kept(path, full_key); kept.has_value()) {
    dense = *std::move(kept);
  } else {
    if (has_stereo) {
      dense = PointsOfMaps(photos, depth, limit);
    } else {
      LITAGS_ASSIGN_OR_RETURN(const DepthMaps maps,
                              StereoOfFew(context, photos, points, point_views));
      dense = PointsOfMaps(photos, maps, limit);
    }
    LITAGS_RETURN_IF_ERROR(Keep(path, full_key, dense));
  }
  context.Note(absl::StrCat("training starts from ", sparse, " sparse points and ", dense.size(),
                            " of stereo depth"));
  return dense;
}

}  // namespace litags
