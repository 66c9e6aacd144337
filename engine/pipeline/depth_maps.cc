#include "engine/pipeline/depth_maps.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "engine/core/counted.h"
#include "engine/core/error.h"
#include "engine/core/mask.h"
#include "engine/core/photo_names.h"
#include "engine/core/pixel_at.h"
#include "engine/core/quantile.h"
#include "engine/core/spread_indices.h"
#include "engine/depth/depth_provider.h"
#include "engine/depth/network_depth.h"
#include "engine/io/container.h"
#include "engine/io/depth_io.h"
#include "engine/io/file_util.h"
#include "engine/io/image_io.h"
#include "engine/io/mask_io.h"
#include "engine/io/wide_lens.h"
#include "engine/pipeline/photo_place.h"
#include "engine/pipeline/photo_screen.h"
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

absl::StatusOr<std::unique_ptr<DepthProvider>> MakeProvider(const Context& context,
                                                            DepthOrigin origin,
                                                            absl::Span<const SparsePoint> points,
                                                            absl::Span<const int> point_views) {
  const ReconstructInput& input = context.input;
  switch (origin) {
    case DepthOrigin::kMaps:
      return MakeFolderDepthProvider(input.depth_dir, &context.report->notes);
    case DepthOrigin::kNetwork:
      return MakeNetworkDepthProvider(input.depth_network, "depth_model");
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
  Fingerprint f;
  LITAGS_RETURN_IF_ERROR(AddNetwork(network, &f));
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

// The kept maps of `views` photos; nothing if there are none, or they are damaged, of something
// else or of another version: they can always be made again.
std::optional<DepthMaps> Kept(const std::string& path, const std::string& key, size_t views) {
  const auto file = Container::Read(path, kKind, kVersion, kVersion);
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

// Of a photo, or of the photo that a view was cut from.
std::string NameThatWasSent(const CutInput& input, const std::string& photo) {
  const auto view = input.rig_views.find(photo);
  return view == input.rig_views.end() ? photo : view->second.rig;
}

// Maps of no photo of the training, as of fisheyes, which became views once their cameras were
// found.
absl::StatusOr<DepthOrigin> OriginFor(const Context& context,
                                      const std::vector<PosedPhoto>& photos) {
  const DepthOrigin origin = ResolveDepthOrigin(context);
  if (origin != DepthOrigin::kMaps || photos.empty()) return origin;
  const std::string& dir = context.input.depth_dir;
  for (const PosedPhoto& photo : photos) {
    if (!FindDepthMap(dir, photo.view->name).empty()) return origin;
  }
  const std::string none = absl::StrCat("none of the ", photos.size(), " training photos, such as ",
                                        photos[0].view->name, ", has a map in the depth folder");
  if (context.options.depth_source == DepthOrigin::kMaps) {
    return InvalidInput("DEPTH_MAP_WITHOUT_PHOTO", "depth_dir",
                        absl::StrCat(none, "; name maps as these, or choose another depth source"));
  }
  context.Note(absl::StrCat(none, ": depth comes from stereo"));
  return DepthOrigin::kStereo;
}

// Puts ranks in place of the k-th numbers, from the mean rank: those that are alike share one.
void RankAroundMean(size_t k, std::vector<std::array<double, 2>>* pairs) {
  const size_t n = pairs->size();
  std::sort(pairs->begin(), pairs->end(),
            [k](const auto& a, const auto& b) { return a[k] < b[k]; });
  for (size_t begin = 0, end = 0; begin < n; begin = end) {
    end = begin + 1;
    while (end < n && (*pairs)[end][k] == (*pairs)[begin][k]) ++end;
    const double rank = (static_cast<double>(begin + end) - static_cast<double>(n)) / 2;
    for (size_t i = begin; i < end; ++i) (*pairs)[i][k] = rank;
  }
}

// Spearman's: of the ranks of both numbers. 0 if all of one are alike.
double RankCorrelation(std::vector<std::array<double, 2>> pairs) {
  for (const size_t k : {0, 1}) RankAroundMean(k, &pairs);
  double product = 0, first = 0, second = 0;
  for (const auto& [a, b] : pairs) {
    product += a * b;
    first += a * a;
    second += b * b;
  }
  return first > 0 && second > 0 ? product / std::sqrt(first * second) : 0;
}

// The loss would push things the wrong way.
absl::Status CheckGrowWithDistance(const std::vector<PosedPhoto>& photos, const DepthMaps& maps,
                                   absl::Span<const SparsePoint> points,
                                   absl::Span<const int> point_views) {
  constexpr size_t kEnough = 50;  // points of a photo; a map by chance has +-0.14
  constexpr double kInverse = -0.5;
  std::vector<std::vector<std::array<double, 2>>> pairs(photos.size());  // distance, map
  for (const SparsePoint& point : points) {
    for (const TrackElement& e : point.track) {
      const int i = point_views[e.view];
      if (i < 0 || !maps[i].has_value()) continue;
      const DepthMap& map = *maps[i];
      const Camera camera = photos[i].view->camera.Scaled(map.depth.width, map.depth.height);
      const auto [x, y, z] = camera.CamFromWorld(point.xyz);
      const double column = camera.fx * x / z + camera.cx, row = camera.fy * y / z + camera.cy;
      const auto pixel = PixelAt(column, row, camera.width, camera.height);
      if (!(z > 0) || !pixel.has_value()) continue;
      const auto [u, v] = *pixel;
      if (!map.confidence.empty() && map.confidence.at(0, v, u) == 0) continue;
      pairs[i].push_back({z, map.depth.at(0, v, u)});
    }
  }
  std::vector<double> correlations;
  for (auto& of_photo : pairs) {
    if (of_photo.size() >= kEnough) correlations.push_back(RankCorrelation(std::move(of_photo)));
  }
  if (correlations.empty()) return absl::OkStatus();
  const double middle = MedianInPlace(correlations);
  if (middle >= kInverse) return absl::OkStatus();
  return InvalidInput(
      "DEPTH_MAP_INVERSE", "depth_dir",
      absl::StrFormat("the depth maps are larger where things are nearer (rank correlation with "
                      "the points that photos saw: %.2f): these are inverse depths; give 1/x, or "
                      "choose another depth source",
                      middle));
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

// Whether maps tell how many times as far one thing is as another. Those of a network's inverse
// depth are made so (network_depth.h).
bool AreDistances(DepthOrigin origin, const DepthNetwork& network) {
  return origin == DepthOrigin::kStereo || (origin == DepthOrigin::kNetwork && network.inverse);
}

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

}  // namespace

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

absl::Status CheckMapsFit(const CutInput& input, std::vector<std::string>* notes) {
  LITAGS_RETURN_IF_ERROR(MakeFolderDepthProvider(input.depth_dir).status());
  LITAGS_ASSIGN_OR_RETURN(const std::vector<std::string> files,
                          ListPhotos(input.images_dir, "images"));
  const std::vector<std::string> photos = PhotosAmong(files);
  const PhotoNames names(photos);
  bool any = false;
  std::vector<std::string> turned;  // photos that EXIF turns into the same shape
  for (const std::string& photo : photos) {
    const std::string path = FindDepthMap(input.depth_dir, photo);
    if (path.empty()) continue;
    any = true;
    const std::string field = absl::StrCat("depth/", BaseName(path));
    LITAGS_RETURN_IF_ERROR(CheckDepthMapIsOf(photo, BaseName(path), names, field));
    LITAGS_ASSIGN_OR_RETURN(const DepthSize map, ReadDepthSize(path, field));
    const auto size = ReadImageSize(PhotoPath(input, photo), PhotoField(photo));
    if (!size.ok()) continue;  // whoever needs it says why
    LITAGS_RETURN_IF_ERROR(CheckDepthShape(map.width, map.height, size->width, size->height, field,
                                           size->orientation));
    const bool fits_stored =
        size->orientation < 5 ||
        CheckDepthShape(map.width, map.height, size->height, size->width, field).ok();
    if (size->orientation != 1 && fits_stored) {
      turned.push_back(absl::StrCat(photo, " (orientation ", size->orientation, ")"));
    }
  }
  if (!turned.empty() && notes != nullptr) {
    notes->push_back(absl::StrCat("EXIF turns ", Counted(turned.size(), "photo"),
                                  " with a depth map, such as ", turned[0], ": ",
                                  turned.size() == 1 ? "its map" : "their maps",
                                  " must be of the photo turned upright"));
  }
  if (any) return absl::OkStatus();
  const std::string& first = photos.front();
  const std::string sent = NameThatWasSent(input, first);
  return InvalidInput(
      "DEPTH_MAP_WITHOUT_PHOTO", "depth_dir",
      absl::StrCat("depth folder '", input.depth_dir, "' has no map of any photo; ",
                   sent == first ? "name maps as their photos"
                                 : sent + " is learnt as several views: give maps of these",
                   ", as ", Stem(first), ".png, .pfm or .npy, or choose another depth source"));
}

std::vector<std::string> NamesOfViews(const std::string& photo) {
  std::vector<std::string> names;
  for (const CubeView& view : kCubeViews) {
    for (const std::string& base : {Stem(photo), photo}) {  // as WithViewsOfWidePhotos() has it
      names.push_back(absl::StrCat(base, "_", view.name, ".png"));
    }
  }
  return names;
}

absl::Status CheckDepthSource(const Context& context) {
  const DepthOrigin origin = ResolveDepthOrigin(context);
  if (origin == DepthOrigin::kMaps && context.input.depth_dir.empty()) {
    return InvalidInput("DEPTH_MAPS_MISSING", "options.depth_source",
                        "options.depth_source: maps were asked for and none were given; give "
                        "depth maps or choose another source");
  }
  if (origin == DepthOrigin::kMaps) {
    LITAGS_RETURN_IF_ERROR(CheckMapsFit(context.input, &context.report->notes));
  }
  if (origin == DepthOrigin::kNetwork && context.input.depth_network.path.empty()) {
    return InvalidInput("DEPTH_MODEL_MISSING", "options.depth_source",
                        "options.depth_source: a network was asked for and this installation "
                        "has none (--depth-model); choose another source");
  }
  return absl::OkStatus();
}

absl::Status AddNetwork(const DepthNetwork& network, Fingerprint* f) {
  LITAGS_RETURN_IF_ERROR(f->AddFile(network.path, "depth_model", kMaxModelBytes));
  f->Add(network.width);
  f->Add(network.height);
  f->Add(network.mean);
  f->Add(network.std);
  f->Add(network.inverse);
  return absl::OkStatus();
}

absl::StatusOr<DepthMaps> MakeDepthMaps(const Context& context,
                                        const std::vector<PosedPhoto>& photos,
                                        absl::Span<const SparsePoint> points,
                                        absl::Span<const int> point_views, const std::string& key) {
  const ReconstructInput& input = context.input;
  const DepthOrigin asked = ResolveDepthOrigin(context);
  if (asked == DepthOrigin::kNone) return DepthMaps();
  LITAGS_ASSIGN_OR_RETURN(const DepthOrigin origin, OriginFor(context, photos));
  if (asked != DepthOrigin::kMaps && !input.depth_dir.empty()) {
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
    if (!map.has_value()) continue;
    ++found;
    if (photos[i].mask != nullptr) ForgetMasked(*photos[i].mask, &*map);
    if (!AreDistances(origin, input.depth_network)) map->edge = EdgeOf(*map);
  }
  if (origin == DepthOrigin::kMaps) {
    if (found == 0) {
      return InvalidInput("DEPTH_MAP_EMPTY", "depth_dir",
                          "no depth map says anything of its photo (all pixels are 0, not finite, "
                          "or of one depth); write the maps again or choose another depth source");
    }
    LITAGS_RETURN_IF_ERROR(CheckGrowWithDistance(photos, *maps, points, point_views));
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
