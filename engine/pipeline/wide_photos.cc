#include "engine/pipeline/wide_photos.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/types/span.h"
#include "engine/core/counted.h"
#include "engine/core/error.h"
#include "engine/core/parallel.h"
#include "engine/io/cameras_io.h"
#include "engine/io/file_util.h"
#include "engine/io/image_io.h"
#include "engine/io/panorama.h"
#include "engine/pipeline/given_cameras.h"
#include "engine/pipeline/photo_place.h"

namespace litags {
namespace {

// Of a view, that the photo must show: of less there is nothing to learn.
constexpr double kLeastShared = 0.05;

std::vector<CubeView> ViewsShown(const WideLens& lens) {
  std::vector<CubeView> shown;
  for (const CubeView& view : kCubeViews) {
    if (SharedBy(lens, view) >= kLeastShared) shown.push_back(view);
  }
  return shown;
}

WidePhoto PanoramaPhoto(const std::string& name, int width, int height, const PanoramaPart& part) {
  const bool whole = part.whole_width <= width && part.whole_height <= height;
  WidePhoto photo{.name = name, .kind = whole ? "panorama" : "part of a panorama"};
  photo.lens = PanoramaLens(width, height, part);
  photo.views = ViewsShown(photo.lens);
  return photo;
}

// A photo that may be a panorama.
struct Candidate {
  std::string name;
  int width = 0, height = 0;                // px
  std::optional<PanoramaPart> stated = {};  // by its metadata
  bool closed = false;                      // as its edges tell
};

void Look(const ReconstructInput& input, Candidate* candidate) {
  const std::string field = PhotoField(candidate->name);
  const auto bytes = ReadFile(PhotoPath(input, candidate->name), field, ImageLimits().max_bytes);
  if (!bytes.ok()) return;
  candidate->stated = StatedPanorama(*bytes, candidate->width, candidate->height);
  if (candidate->stated || candidate->width != 2 * candidate->height) return;
  const auto photo = DecodePhoto(*bytes, field);
  candidate->closed = photo.ok() && IsClosedAround(*photo);
}

// Edges say less than metadata: of ordinary photos cut to this shape, 2 % seem closed, 13 % in one
// dark capture. So they count where three and three quarters of the photos of a size are closed,
// and then for all of these.
absl::StatusOr<std::vector<WidePhoto>> FindPanoramas(const ReconstructInput& input,
                                                     const std::vector<std::string>& names,
                                                     int threads, const CancelToken& cancel) {
  constexpr int kLeastClosed = 3;
  constexpr double kShareClosed = 0.75;
  std::vector<Candidate> candidates;
  for (const std::string& name : names) {
    const auto size = ReadImageSize(PhotoPath(input, name), PhotoField(name));
    if (size.ok()) candidates.push_back({name, size->width, size->height});
  }
  ParallelFor(threads, candidates.size(), [&](size_t i, int) {
    if (!cancel.IsCancelled()) Look(input, &candidates[i]);
  });
  LITAGS_RETURN_IF_ERROR(cancel.Check());
  std::map<int, std::pair<int, int>> closed_of;  // by width, of those twice as wide as high
  for (const Candidate& candidate : candidates) {
    if (candidate.width != 2 * candidate.height) continue;
    closed_of[candidate.width].first += candidate.closed || candidate.stated;
    ++closed_of[candidate.width].second;
  }
  std::vector<WidePhoto> panoramas;
  for (const Candidate& c : candidates) {
    std::optional<PanoramaPart> part = c.stated;
    if (!part && c.width == 2 * c.height) {
      const auto& [closed, all] = closed_of[c.width];
      const bool like_others = closed >= kLeastClosed && closed >= kShareClosed * all;
      if (like_others) part = WholePanorama(c.width, c.height);
    }
    if (!part) continue;
    WidePhoto photo = PanoramaPhoto(c.name, c.width, c.height, *part);
    // A small part is much as a photo is.
    if (!photo.views.empty()) panoramas.push_back(std::move(photo));
  }
  return panoramas;
}

// Photos of one fisheye.
struct LensPhotos {
  Camera camera;
  Distortion lens;
  std::vector<int> views;
};

bool IsWideFisheye(const Camera& camera, const Distortion& lens) {
  return lens.fisheye && FisheyeReach(camera, lens) > kWidestPinhole;
}

std::vector<LensPhotos> PhotosByFisheye(const SparseModel& cameras) {
  std::vector<LensPhotos> lenses;
  std::map<std::vector<double>, size_t> index;
  for (size_t i = 0; i < cameras.views.size(); ++i) {
    const Camera& c = cameras.views[i].camera;
    const Distortion& d = cameras.distortions[i];
    if (!IsWideFisheye(c, d)) continue;
    const std::vector<double> key = {
        double(c.width), double(c.height), c.fx, c.fy, c.cx, c.cy, d.k1, d.k2, d.k3, d.k4};
    const auto [found, is_new] = index.emplace(key, lenses.size());
    if (is_new) lenses.push_back({c, d, {}});
    lenses[found->second].views.push_back(static_cast<int>(i));
  }
  return lenses;
}

// The circle of photos spread evenly over those of a fisheye.
double CircleOf(const ReconstructInput& input, const SparseModel& cameras, const LensPhotos& lens,
                const CancelToken& cancel) {
  constexpr size_t kLooked = 8;
  const size_t n = std::min(kLooked, lens.views.size());
  const auto read = [&](size_t i) -> std::optional<Photo> {
    if (cancel.IsCancelled()) return std::nullopt;
    const std::string& name = cameras.views[lens.views[i * lens.views.size() / n]].name;
    auto photo = ReadPhoto(PhotoPath(input, name), PhotoField(name));
    if (!photo.ok()) return std::nullopt;
    return *std::move(photo);
  };
  return FindCircle(n, read, lens.camera);
}

absl::StatusOr<WidePhotos> FindGiven(const ReconstructInput& input,
                                     const std::vector<std::string>& names,
                                     const CancelToken& cancel) {
  WidePhotos wide;
  std::vector<std::string> readable;
  for (const std::string& name : names) {
    if (ReadImageSize(PhotoPath(input, name), PhotoField(name)).ok()) readable.push_back(name);
  }
  if (readable.empty()) return wide;
  PanoramaNames panoramas;
  ReconstructInput resolved = input;
  resolved.cameras_path = ResolveCameras(input.cameras_path);
  auto cameras = ReadGivenCameras(resolved, readable, &wide.notes, &panoramas);
  if (!cameras.ok()) {
    if (!panoramas.empty()) return cameras.status();
    return wide;
  }
  wide.cameras = *std::move(cameras);
  for (size_t i = 0; i < wide.cameras.views.size(); ++i) {
    const auto& [name, camera] = wide.cameras.views[i];
    if (!panoramas.contains(name)) continue;
    if (camera.width != 2 * camera.height) {
      return InvalidInput(
          "CAMERA_SIZE_MISMATCH", PhotoField(name),
          absl::StrCat(name, ": its camera is that of a panorama, but the photo is ", camera.width,
                       "x", camera.height, " px; give all of the sphere, twice as wide as high"));
    }
    wide.photos.push_back(PanoramaPhoto(name, camera.width, camera.height,
                                        WholePanorama(camera.width, camera.height)));
    wide.photos.back().camera = static_cast<int>(i);
  }
  for (const LensPhotos& lens : PhotosByFisheye(wide.cameras)) {
    WidePhoto photo{.kind = "fisheye"};
    photo.lens = FisheyeLens(lens.camera, lens.lens, CircleOf(input, wide.cameras, lens, cancel));
    LITAGS_RETURN_IF_ERROR(cancel.Check());
    photo.views = ViewsShown(photo.lens);
    if (photo.views.empty()) continue;  // of a tiny circle
    for (const int view : lens.views) {
      photo.name = wide.cameras.views[static_cast<size_t>(view)].name;
      photo.camera = view;
      wide.photos.push_back(photo);
    }
  }
  std::sort(wide.photos.begin(), wide.photos.end(),
            [](const WidePhoto& a, const WidePhoto& b) { return a.name < b.name; });
  return wide;
}

// Pixels of several photos at one distance from the centre of a fisheye: what light there is.
struct Ring {
  double pixels = 0, sum = 0, squares = 0;

  void Add(double sample) {
    ++pixels;
    sum += sample;
    squares += sample * sample;
  }
  void Add(const Ring& other) {
    pixels += other.pixels;
    sum += other.sum;
    squares += other.squares;
  }
  double Mean() const { return sum / pixels; }
  double Deviation() const { return std::sqrt(std::max(squares / pixels - Mean() * Mean(), 0.0)); }
};

Ring Sum(absl::Span<const Ring> rings) {
  Ring all;
  for (const Ring& ring : rings) all.Add(ring);
  return all;
}

constexpr size_t kEdge = 2;  // rings on either side of a circle's edge, over which it fades

// Whether light ends at this ring, as it does at the edge of a circle with black around: across the
// ring it falls by more than the noise of a pixel beyond, and by more than it falls from there to
// the corners. In a dark photo that has light up to its corners, noise hides where it gets weak.
bool LightEndsAt(absl::Span<const Ring> rings, size_t ring) {
  constexpr size_t kBlack = 5 * kEdge;  // rings that tell whether light goes on falling
  if (ring < kEdge || ring + kEdge + kBlack > rings.size()) return false;
  const absl::Span<const Ring> beyond = rings.subspan(ring + kEdge);
  const double fall = rings[ring - kEdge].Mean() - beyond[0].Mean();
  const double left = beyond[0].Mean() - Sum(beyond.subspan(beyond.size() / 2)).Mean();
  return fall > Sum(beyond).Deviation() && fall > left;
}

// The last ring with light where black is around. `last` tells where about: the light of lenses
// carries it beyond the edge, noise keeps it within.
std::optional<size_t> LastLitRing(absl::Span<const Ring> rings, size_t last) {
  constexpr size_t kBeyond = 20;  // of 200
  for (size_t ring = rings.size(); ring-- > std::max(last, kBeyond) - kBeyond;) {
    if (LightEndsAt(rings, ring)) return ring - kEdge;
  }
  return std::nullopt;
}

}  // namespace

absl::StatusOr<WidePhotos> FindWidePhotos(const ReconstructInput& input,
                                          const std::vector<std::string>& names, int threads,
                                          const CancelToken& cancel) {
  if (!input.cameras_path.empty()) return FindGiven(input, names, cancel);
  WidePhotos wide;
  LITAGS_ASSIGN_OR_RETURN(wide.photos, FindPanoramas(input, names, threads, cancel));
  return wide;
}

bool StatesViews(std::string_view bytes, int width, int height) {
  const std::optional<PanoramaPart> part = StatedPanorama(bytes, width, height);
  return part.has_value() && !ViewsShown(PanoramaLens(width, height, *part)).empty();
}

bool HasWideFisheye(const SparseModel& cameras) {
  for (size_t i = 0; i < cameras.views.size(); ++i) {
    if (IsWideFisheye(cameras.views[i].camera, cameras.distortions[i])) return true;
  }
  return false;
}

std::vector<std::string> DescribeWidePhotos(const std::vector<WidePhoto>& photos) {
  std::map<std::pair<std::string, size_t>, std::vector<std::string>> names;
  for (const WidePhoto& photo : photos) {
    names[{photo.kind, photo.views.size()}].push_back(photo.name);
  }
  const std::map<std::string, std::string> many = {{"panorama", "panoramas of the whole sphere"},
                                                   {"part of a panorama", "parts of panoramas"},
                                                   {"fisheye", "fisheyes"}};
  std::vector<std::string> lines;
  for (const auto& [kind, of_kind] : names) {
    if (of_kind.size() == 1) {
      lines.push_back(absl::StrCat(of_kind[0], " is a ", kind.first, ": ",
                                   Counted(kind.second, "view"), " of it ",
                                   kind.second == 1 ? "is a photo" : "are the photos"));
      continue;
    }
    lines.push_back(absl::StrCat(of_kind.size(), " photos are ", many.at(kind.first), ", such as ",
                                 of_kind[0], ": ", Counted(kind.second, "view"), " of each ",
                                 kind.second == 1 ? "is a photo" : "are the photos"));
  }
  return lines;
}

double FindCircle(size_t photos, absl::FunctionRef<std::optional<Photo>(size_t)> read,
                  const Camera& camera) {
  constexpr int kRings = 200;
  constexpr int kNoise = 2 * kPhotoCode, kDark = 20 * kPhotoCode;  // codes: JPEG's, video's black
  constexpr double kPicture = 0.25;  // of a ring's pixels, that differ from the corner
  constexpr double kSoft = 0.01;     // of the radius: the circle's edge fades
  const double farthest = std::hypot(std::max(camera.cx, camera.width - camera.cx),
                                     std::max(camera.cy, camera.height - camera.cy));
  int last = -1;  // ring that is of the picture in some photo
  std::vector<Ring> rings(kRings + 1);
  for (size_t k = 0; k < photos; ++k) {
    const std::optional<Photo> decoded = read(k);
    if (!decoded) continue;
    const Photo& photo = *decoded;
    const int16_t* const corner = photo.pixel(0, 0);
    if (*std::max_element(corner, corner + 3) > kDark)
      return std::numeric_limits<double>::infinity();
    std::array<int, kRings + 1> all = {}, differ = {};
    for (int y = 0; y < photo.height; ++y) {
      for (int x = 0; x < photo.width; ++x) {
        const double radius = std::hypot(x + 0.5 - camera.cx, y + 0.5 - camera.cy);
        const auto ring = static_cast<size_t>(kRings * radius / farthest);
        const int16_t* const pixel = photo.pixel(x, y);
        int largest = 0;
        for (int c = 0; c < 3; ++c) largest = std::max(largest, std::abs(pixel[c] - corner[c]));
        rings[ring].Add((pixel[0] + pixel[1] + pixel[2]) / 3.0);
        ++all[ring];
        differ[ring] += largest > kNoise;
      }
    }
    for (int ring = last + 1; ring <= kRings; ++ring) {
      const auto i = static_cast<size_t>(ring);
      const double chance = 3 * std::sqrt(all[i] * kPicture * (1 - kPicture));  // of small rings
      if (differ[i] > kPicture * all[i] + chance) last = ring;
    }
  }
  if (last < 0) return std::numeric_limits<double>::infinity();
  const std::optional<size_t> lit = LastLitRing(rings, static_cast<size_t>(last));
  if (!lit) return std::numeric_limits<double>::infinity();
  return (1 - kSoft) * static_cast<double>(*lit + 1) * farthest / kRings;
}

}  // namespace litags
