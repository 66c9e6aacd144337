#include "engine/pipeline/depth_maps.h"

#include <algorithm>
#include <memory>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/core/mask.h"
#include "engine/core/spread_indices.h"
#include "engine/depth/depth_provider.h"
#include "engine/depth/network_depth.h"
#include "engine/io/container.h"
#include "engine/io/depth_io.h"
#include "engine/io/file_util.h"
#include "engine/io/image_io.h"
#include "engine/io/mask_io.h"
#include "engine/pipeline/fingerprint.h"
#include "engine/stereo/stereo.h"

namespace litags {
namespace {

constexpr char kKind[] = "depth maps";
constexpr uint32_t kVersion = 3;
constexpr int64_t kMaxModelBytes = int64_t{4} << 30;

const char* Describe(DepthOrigin origin) {
  switch (origin) {
    case DepthOrigin::kMaps:
      return "uploaded maps";
    case DepthOrigin::kStereo:
      return "stereo";
    case DepthOrigin::kNetwork:
      return "the operator's network";
    case DepthOrigin::kAuto:
    case DepthOrigin::kNone:
      break;
  }
  return "no source";
}

absl::StatusOr<std::unique_ptr<DepthProvider>> MakeNetwork(const DepthNetwork& network) {
  NetworkDepthOptions options;
  options.path = network.path;
  options.input.width = network.width;
  options.input.height = network.height;
  options.input.mean = network.mean;
  options.input.std = network.std;
  options.inverse = network.inverse;
  return MakeNetworkDepthProvider(options, "depth_model");
}

absl::StatusOr<std::unique_ptr<DepthProvider>> MakeProvider(const Context& context,
                                                            DepthOrigin origin,
                                                            absl::Span<const SparsePoint> points,
                                                            absl::Span<const int> point_views) {
  const ReconstructInput& input = context.input;
  switch (origin) {
    case DepthOrigin::kMaps:
      return MakeFolderDepthProvider(input.depth_dir);
    case DepthOrigin::kNetwork:
      return MakeNetwork(input.depth_network);
    case DepthOrigin::kStereo: {
      StereoOptions stereo;
      stereo.threads = context.options.threads;
      return MakeStereoDepthProvider(
          PointsOfFew(points, point_views, StereoPhotos(context.recipe, context.options)), stereo);
    }
    case DepthOrigin::kAuto:
    case DepthOrigin::kNone:
      break;
  }
  return absl::InternalError("no depth source to make");
}

// What the kept maps must have been made from.
absl::StatusOr<std::string> KeyOf(DepthOrigin origin, const DepthNetwork& network, int photos,
                                  const std::string& key) {
  if (origin == DepthOrigin::kStereo)
    return absl::StrCat(photos == 0 ? "stereo " : absl::StrCat("stereo of ", photos, " "), key);
  LITAGS_ASSIGN_OR_RETURN(const std::string bytes,
                          ReadFile(network.path, "depth_model", kMaxModelBytes));
  Fingerprint f;
  f.Add(bytes.data(), bytes.size());
  f.Add(network.width);
  f.Add(network.height);
  for (int c = 0; c < 3; ++c) {
    f.Add(network.mean[c]);
    f.Add(network.std[c]);
  }
  f.Add(network.inverse);
  return absl::StrCat("network ", f.Text(), " ", key);
}

absl::Status Keep(const std::string& path, const std::string& key, const DepthMaps& maps) {
  ContainerWriter writer(kKind, kVersion);
  writer.AddSectionView("key", key);
  std::vector<int32_t> sizes(2 * maps.size());  // width and height of each; 0: none
  for (size_t i = 0; i < maps.size(); ++i) {
    if (!maps[i].has_value()) continue;
    sizes[2 * i] = maps[i]->depth.width;
    sizes[2 * i + 1] = maps[i]->depth.height;
  }
  writer.AddArrayView("sizes", sizes);
  for (size_t i = 0; i < maps.size(); ++i) {
    if (!maps[i].has_value()) continue;
    writer.AddArrayView(absl::StrCat("depth ", i), maps[i]->depth.data);
    writer.AddArrayView(absl::StrCat("confidence ", i), maps[i]->confidence.data);
  }
  return writer.Commit(path);
}

// One plane, or none where it may be empty; false if there are not as many values.
bool ToPlane(std::vector<float> values, int width, int height, bool may_be_empty, Planes* plane) {
  if (values.empty() && may_be_empty) return true;
  if (width <= 0 || height <= 0 || values.size() != size_t(width) * height) return false;
  plane->channels = 1;
  plane->width = width;
  plane->height = height;
  plane->data = std::move(values);
  return true;
}

// The kept maps of `views` photos; nothing if there are none, or they are damaged or of something
// else: they can always be made again.
std::optional<DepthMaps> Kept(const std::string& path, const std::string& key, size_t views) {
  const auto file = Container::Read(path, kKind, kVersion);
  if (!file.ok()) return std::nullopt;
  const auto kept_key = file->Section("key");
  const auto sizes = file->Array<int32_t>("sizes");
  if (!kept_key.ok() || *kept_key != key || !sizes.ok() || sizes->size() != 2 * views) {
    return std::nullopt;
  }
  DepthMaps maps(views);
  for (size_t i = 0; i < views; ++i) {
    const int width = (*sizes)[2 * i], height = (*sizes)[2 * i + 1];
    if (width == 0) continue;
    auto depth = file->Array<float>(absl::StrCat("depth ", i));
    auto confidence = file->Array<float>(absl::StrCat("confidence ", i));
    if (!depth.ok() || !confidence.ok()) return std::nullopt;
    DepthMap& map = maps[i].emplace();
    if (!ToPlane(*std::move(depth), width, height, false, &map.depth) ||
        !ToPlane(*std::move(confidence), width, height, true, &map.confidence)) {
      return std::nullopt;
    }
  }
  return maps;
}

// Maps of no photo would leave the depth loss off.
absl::Status CheckMapsFit(const ReconstructInput& input) {
  LITAGS_RETURN_IF_ERROR(MakeFolderDepthProvider(input.depth_dir).status());
  LITAGS_ASSIGN_OR_RETURN(const std::vector<std::string> photos,
                          ListPhotos(input.images_dir, "images"));
  for (const std::string& photo : photos) {
    if (!FindDepthMap(input.depth_dir, Stem(photo)).empty()) return absl::OkStatus();
  }
  return InvalidInput(
      "DEPTH_MAP_WITHOUT_PHOTO", "depth_dir",
      absl::StrCat("depth folder '", input.depth_dir,
                   "' has no map of any photo; name maps as their photos, as ",
                   Stem(photos.front()), ".png, .pfm or .npy, or choose another depth source"));
}

void ForgetMasked(const PlaneU8& mask, DepthMap* map) {
  if (mask.empty()) return;
  const int width = map->depth.width, height = map->depth.height;
  if (map->confidence.empty()) {
    map->confidence = Planes(1, height, width);
    std::fill(map->confidence.data.begin(), map->confidence.data.end(), 1.0f);
  }
  const PlaneU8 small =
      ChangeMask(mask, [&](const ImageU8& image) { return ResizeArea(image, width, height); });
  ForMasked(small, [&](size_t i) { map->depth.data[i] = map->confidence.data[i] = 0; });
}

}  // namespace

std::vector<SparsePoint> PointsOfTraining(absl::Span<const SparsePoint> points,
                                          absl::Span<const int> point_views) {
  std::vector<SparsePoint> out(points.begin(), points.end());
  for (SparsePoint& point : out) {
    const auto is_out = [&](const TrackElement& e) { return point_views[e.view] < 0; };
    std::erase_if(point.track, is_out);
    for (TrackElement& e : point.track) e.view = point_views[e.view];
  }
  return out;
}

std::vector<SparsePoint> PointsOfFew(absl::Span<const SparsePoint> points,
                                     absl::Span<const int> point_views, int most) {
  std::vector<SparsePoint> out = PointsOfTraining(points, point_views);
  if (most == 0) return out;
  int last = -1;
  for (const int view : point_views) last = std::max(last, view);
  std::vector<bool> used(last + 1);
  for (const size_t view : SpreadIndices(used.size(), most)) used[view] = true;
  for (SparsePoint& point : out) {
    std::erase_if(point.track, [&](const TrackElement& e) { return !used[e.view]; });
  }
  return out;
}

int StereoPhotos(const Recipe& recipe, const ReconstructOptions& options) {
  return options.depth_source == DepthOrigin::kStereo ? 0 : recipe.stereo_photos;
}

DepthOrigin ResolveDepthOrigin(const Recipe& recipe, const ReconstructOptions& options,
                               const ReconstructInput& input) {
  if (!recipe.use_depth || !recipe.lita) return DepthOrigin::kNone;
  if (options.depth_source != DepthOrigin::kAuto) return options.depth_source;
  return input.depth_dir.empty() ? DepthOrigin::kStereo : DepthOrigin::kMaps;
}

absl::Status CheckDepthSource(const Context& context) {
  const DepthOrigin origin = ResolveDepthOrigin(context);
  if (origin == DepthOrigin::kMaps && context.input.depth_dir.empty()) {
    return InvalidInput("DEPTH_MAPS_MISSING", "options.depth_source",
                        "options.depth_source: maps were asked for and none were given; give "
                        "depth maps or choose another source");
  }
  if (origin == DepthOrigin::kMaps) LITAGS_RETURN_IF_ERROR(CheckMapsFit(context.input));
  if (origin == DepthOrigin::kNetwork && context.input.depth_network.path.empty()) {
    return InvalidInput("DEPTH_MODEL_MISSING", "options.depth_source",
                        "options.depth_source: a network was asked for and this installation "
                        "has none (--depth-model); choose another source");
  }
  return absl::OkStatus();
}

absl::StatusOr<DepthMaps> MakeDepthMaps(const Context& context,
                                        const std::vector<PosedPhoto>& photos,
                                        absl::Span<const SparsePoint> points,
                                        absl::Span<const int> point_views, const std::string& key) {
  const ReconstructInput& input = context.input;
  const DepthOrigin origin = ResolveDepthOrigin(context);
  if (origin == DepthOrigin::kNone) return DepthMaps();
  LITAGS_RETURN_IF_ERROR(CheckDepthSource(context));
  if (origin != DepthOrigin::kMaps && !input.depth_dir.empty()) {
    context.Note(absl::StrCat("the depth maps given are not used: depth comes from ",
                              Describe(origin), " (depth_source)"));
  }
  LITAGS_ASSIGN_OR_RETURN(const std::unique_ptr<DepthProvider> provider,
                          MakeProvider(context, origin, points, point_views));
  const bool keep = origin != DepthOrigin::kMaps;
  const std::string path = input.work_dir + "/depth.litags";
  std::string full_key;
  std::optional<DepthMaps> maps;
  if (keep) {
    LITAGS_ASSIGN_OR_RETURN(full_key, KeyOf(origin, input.depth_network,
                                            StereoPhotos(context.recipe, context.options), key));
    maps = Kept(path, full_key, photos.size());
  }
  if (!maps.has_value()) {
    LITAGS_ASSIGN_OR_RETURN(maps, provider->Maps(photos, context.cancel, [&](int done, int total) {
      context.progress(Stage::kPreparing, absl::StrCat("depth by ", Describe(origin), ": ", done,
                                                       " of ", total, " photos"));
    }));
    if (keep) LITAGS_RETURN_IF_ERROR(Keep(path, full_key, *maps));
  }
  int found = 0;
  for (size_t i = 0; i < photos.size(); ++i) {
    std::optional<DepthMap>& map = (*maps)[i];
    found += map.has_value();
    if (map.has_value() && photos[i].mask != nullptr) ForgetMasked(*photos[i].mask, &*map);
  }
  context.report->depth_used = found > 0;
  std::string note = absl::StrCat("depth from ", Describe(origin), ": ", found, " of ",
                                  photos.size(), " training photos have a map");
  if (found < static_cast<int>(photos.size())) {
    absl::StrAppend(&note, "; the others train without");
  }
  context.Note(std::move(note));
  return *std::move(maps);
}

}  // namespace litags
