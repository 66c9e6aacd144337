#include "engine/pipeline/capture_checks.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "engine/core/color.h"
#include "engine/core/counted.h"
#include "engine/core/error.h"
#include "engine/core/mask.h"
#include "engine/render/renderer.h"
#include "engine/target/sample_counts.h"

namespace litags {
namespace {

constexpr double kNotFlat = 1e-3;            // part of a photo's pixels
constexpr int kSameSample = kPhotoCode / 8;  // differences up to it are none
constexpr double kMostlyBlack = 0.5;         // of the pixels: the median one is black
// Hundredths of a kelvin, of a room or a forest, lie within 12 codes of 255, from 110 on. Choice
constexpr int kCloseCodes = 16;
constexpr double kMixedExposureStops = 2;  // a camera on automatic stays below
// The near plane is this share of the depth that all but kNearest of what photos saw has. Choices
constexpr double kNearShare = 0.5, kNearest = 0.01;
constexpr double kLeastNearPlane = 1e-5;  // scene units; sizes of Gaussians end at 1e-7
constexpr double kMaxCoordinate = 1e15;   // scene units; squares of sizes must fit into floats

}  // namespace

std::optional<std::array<uint8_t, 3>> FlatColor(const Photo& photo, const PlaneU8& mask) {
  const size_t n = CountedPixels(mask, photo.pixels());
  // A colour that most pixels have is the middle one of every channel.
  std::array<int, 3> color;
  for (int c = 0; c < 3; ++c) {
    SampleCounts counts;
    ForCounted(mask, photo.pixels(), [&](size_t i) { counts.Add(photo.data[3 * i + c]); });
    color[c] = counts.Median();
  }
  size_t others = 0;
  ForCounted(mask, photo.pixels(), [&](size_t i) {
    bool other = false;
    for (int c = 0; c < 3; ++c) other |= std::abs(photo.data[3 * i + c] - color[c]) > kSameSample;
    others += other;
  });
  if (others > kNotFlat * n) return std::nullopt;
  std::array<uint8_t, 3> codes;
  for (int c = 0; c < 3; ++c) {
    codes[c] = static_cast<uint8_t>(std::clamp(std::lround(color[c] / kPhotoCode), 0L, 255L));
  }
  return codes;
}

PhotoDarkness MeasureDarkness(const Photo& photo, const PlaneU8& mask, const ImageInfo& info) {
  PhotoDarkness darkness;
  const size_t counted = CountedPixels(mask, photo.pixels());
  if (SignificantBits(info) == 8) {
    size_t black = 0;
    ForCounted(mask, photo.pixels(),
               [&](size_t i) { black += Luma(&photo.data[3 * i]) < kPhotoCode; });
    darkness.black = static_cast<double>(black) / counted;
  } else if (info.format == ImageFormat::kPng || info.format == ImageFormat::kTiff) {
    // One 8-bit code is 257 of 65535.
    const auto [least, most] = std::minmax_element(photo.data.begin(), photo.data.end());
    darkness.narrow = *least < *most && *most < kPhotoCode;
    darkness.close = *most - *least < kCloseCodes * kPhotoCode && 2 * *least > *most;
  }
  return darkness;
}

void NoteDarkness(const std::vector<View>& views, const std::vector<PhotoDarkness>& photos,
                  std::vector<std::string>* notes) {
  double black = 0;
  for (const PhotoDarkness& photo : photos) black += photo.black / photos.size();
  if (black > kMostlyBlack) {
    notes->push_back(absl::StrFormat(
        "%.0f %% of the photos' pixels are below code 1 of 255: what is there can only be guessed; "
        "longer exposures or RAW files would show it",
        100 * black));
  }
  const auto note = [&](bool PhotoDarkness::*member, const char* what) {
    const auto is = [&](const PhotoDarkness& photo) { return photo.*member; };
    const auto count = std::count_if(photos.begin(), photos.end(), is);
    if (count == 0) return;
    const auto first = std::find_if(photos.begin(), photos.end(), is) - photos.begin();
    notes->push_back(absl::StrCat("all values of ", Counted(count, "photo"),
                                  " of 16 bits, such as ", views[first].name, ", ", what));
  };
  note(&PhotoDarkness::narrow,
       "are below 256: they are taken for light far below white; if they are codes of 8 bits, save "
       "them in files of 8 bits");
  note(&PhotoDarkness::close,
       "lie close together and far from 0, as temperatures do: as light they show next to nothing; "
       "stretch them to the whole range, those of all photos alike");
}

void NoteExposures(const std::vector<View>& views, const std::vector<double>& exposures,
                   bool evened_out, std::vector<std::string>* notes) {
  const auto [least, most] = std::minmax_element(exposures.begin(), exposures.end());
  const double stops = std::log2(*most / *least);
  if (!(stops > kMixedExposureStops)) return;
  notes->push_back(absl::StrFormat(
      "exposures differ by %.1f stops (darkest %s, brightest %s)%s", stops,
      views[least - exposures.begin()].name, views[most - exposures.begin()].name,
      evened_out ? ": they are evened out, and the original light is that of the median exposure"
                 : ", and this tone does not even them out"));
}

float NearPlaneOf(const SparseModel& model) {
  const float usual = RenderSettings().near_plane;
  std::vector<double> depths;
  for (const SparsePoint& point : model.points) {
    for (const TrackElement& e : point.track) {
      const double depth = model.views[e.view].camera.CamFromWorld(point.xyz)[2];
      if (depth > 0) depths.push_back(depth);
    }
  }
  if (depths.empty()) return usual;
  const auto nearest = depths.begin() + static_cast<ptrdiff_t>(kNearest * depths.size());
  std::nth_element(depths.begin(), nearest, depths.end());
  return static_cast<float>(std::clamp<double>(kNearShare * *nearest, kLeastNearPlane, usual));
}

absl::Status CheckScale(const std::vector<View>& views, float near_plane,
                        std::vector<SparsePoint>* points, std::vector<std::string>* notes) {
  const auto far = [](const std::array<double, 3>& p) {
    return !(std::max({std::abs(p[0]), std::abs(p[1]), std::abs(p[2])}) <= kMaxCoordinate);
  };
  for (const View& v : views) {
    if (!far(v.camera.Center())) continue;
    return InvalidInput("SCENE_TOO_LARGE", "cameras",
                        absl::StrCat("cameras: ", v.name, " stands more than ", kMaxCoordinate,
                                     " units from the origin; divide all positions, of cameras "
                                     "and points, by one number"));
  }
  const size_t dropped = std::erase_if(*points, [&](const SparsePoint& p) { return far(p.xyz); });
  if (dropped > 0) {
    notes->push_back(absl::StrCat(Counted(dropped, "sparse point"), dropped == 1 ? " was" : " were",
                                  " dropped: beyond ", kMaxCoordinate, " units"));
  }
  const auto near = [&](const SparsePoint& p) {
    return std::all_of(views.begin(), views.end(), [&](const View& v) {
      return v.camera.CamFromWorld(p.xyz)[2] <= near_plane;
    });
  };
  const size_t hidden = std::count_if(points->begin(), points->end(), near);
  if (2 * hidden <= points->size()) return absl::OkStatus();
  return InvalidInput(
      "SCENE_TOO_SMALL", "cameras",
      absl::StrCat("cameras: ", hidden, " of ", points->size(), " points are nearer than ",
                   near_plane,
                   " units to every camera that they are in front of, and such things "
                   "are not drawn; multiply all positions, of cameras and points, by one number"));
}

}  // namespace litags
