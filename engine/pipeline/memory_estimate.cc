#include "engine/pipeline/memory_estimate.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_format.h"
#include "engine/core/counted.h"
#include "engine/core/error.h"
#include "engine/core/parallel.h"
#include "engine/core/shrunk_size.h"
#include "engine/core/splats.h"
#include "engine/core/spread_indices.h"
#include "engine/io/depth_io.h"
#include "engine/io/file_util.h"
#include "engine/pipeline/depth_maps.h"
#include "engine/pipeline/posed_photos.h"
#include "engine/render/renderer.h"
#include "engine/stereo/stereo.h"

namespace litags {
namespace {

// Bytes a pixel of a TrainView: photo and target of three 16-bit samples, structure, information.
constexpr double kPhotoPixel = 3 * sizeof(int16_t), kViewPixel = 2 * kPhotoPixel + 2;
// Smaller copies have a quarter, a sixteenth, ... of the pixels.
double WithPyramid(int levels) { return (1 - std::pow(0.25, levels + 1)) / 0.75; }

constexpr int kDepthPixel = sizeof(float), kConfidencePixel = sizeof(float);

// Pixels of a depth map and its copies for the smaller photos: each as large as the photo at most,
// and a map that is smaller is copied as it is. `map` 0: as large as the photo.
double DepthPixels(double map, double photo, int levels) {
  double pixels = 0;
  for (int level = 0; level <= levels; ++level, photo /= 4) {
    pixels += map > 0 ? std::min(map, photo) : photo;
  }
  return pixels;
}

// Bytes a pixel of the photo in work: rendered planes, their gradients and what they are compared
// with, floats, and the lists of tiles with their gradients, some 100 bytes for every second pixel.
// Measured: 30 whole photos (crop_pixels 0) of 1600x1064 peak at 1,184 MB with coarse_levels 0;
// photos are 715 of it.
constexpr double kTrainPixel = sizeof(float) * (2 * (kNumChannels + 1) + 8) + 50;

// Bytes a compared pixel that the denoiser keeps of one forward and backward pass (pdm.cc): all
// stages' activations, R_0..R_K before the clamp, R_1..R_K, gradients of both and of hidden layers.
double PdmPixel(const PdmOptions& pdm) {
  const int k = pdm.stages, hidden = pdm.hidden;
  return double(sizeof(float)) * (k * (3 + 2 * hidden) + 3 * (k + 1) + 3 * k + 2 * 3 + 2 * hidden);
}

// Bytes a pixel as the file has it, for every thread that decodes: coefficients and samples.
// Measured: 17.8.
constexpr double kDecodePixel = 18;

// The same with colours of deep shadow at all scales, which are measured on a few photos before any
// is kept. Measured: litags-train on eight JPEGs of 10.8 megapixels peaks 51.6 times their pixels
// higher with two threads than with one.
constexpr double kColorsPixel = 50;

// Bytes a pixel at the size of training, for every thread that makes targets of Tone::kCapture:
// some six pictures of floats (SmoothChroma, FillHighlights). Measured: 72 to 78.
constexpr double kTargetPixel = 80;

// Stereo's costs, and their sums in 16 bits, of some 256 labels a pixel; of photos of 320 px and so
// many views at once at most (engine/stereo/stereo.cc).
constexpr double kStereoPixel = 3 * 256, kStereoView = 60e6;
constexpr int kStereoViews = 8;

// Parameters and two moments, beside which density control makes one of the three anew and copies
// those that grow; and records of a view.
constexpr double kGaussian = sizeof(float) * (kSplatRows * 5 + 40);

int ThreadsOf(const ReconstructOptions& options) {
  return options.threads > 0 ? options.threads : DefaultThreadCount();
}

std::string GiB(int64_t bytes) { return absl::StrFormat("%.1f GiB", bytes / double(1 << 30)); }

// What fits into `bytes`: fewer threads, which cost time alone; else smaller photos; else both.
std::string Advice(absl::Span<const ScreenedPhoto> photos, const ReconstructOptions& options,
                   const PhotoMaps& maps, int64_t bytes) {
  const int all = ThreadsOf(options);
  const auto most = [&](const ReconstructOptions& o, int threads) {
    return EstimateMemory(photos, o, threads, maps).Most();
  };
  for (int threads = all - 1; threads > 0; --threads) {
    const int64_t takes = most(options, threads);
    if (takes <= bytes) return absl::StrFormat("threads %d takes %s at most", threads, GiB(takes));
  }
  constexpr int kStep = 100, kLeastSide = 300;  // px
  int largest = 0;
  for (const ScreenedPhoto& photo : photos) {
    largest = std::max({largest, photo.width, photo.height});
  }
  if (options.max_image_side > 0) largest = std::min(largest, options.max_image_side);
  ReconstructOptions smaller = options;
  for (const int threads : {all, 1}) {
    const std::string fewer = threads < all ? " with threads 1" : "";
    const auto takes = [&](int step) {
      smaller.max_image_side = step * kStep;
      return most(smaller, threads);
    };
    int fits = kLeastSide / kStep - 1, largest_step = (largest - 1) / kStep;
    while (fits < largest_step) {
      const int middle = (fits + largest_step + 1) / 2;
      if (takes(middle) <= bytes) {
        fits = middle;
      } else {
        largest_step = middle - 1;
      }
    }
    if (fits * kStep < kLeastSide) continue;
    return absl::StrFormat("max_image_side %d%s takes %s at most; or leave photos out",
                           fits * kStep, fewer, GiB(takes(fits)));
  }
  return "leave photos out";
}

}  // namespace

PhotoMaps MapsOf(absl::Span<const ScreenedPhoto> photos, const ReconstructInput& input,
                 const ReconstructOptions& options, bool masks) {
  const Recipe recipe = options.ResolveRecipe();
  PhotoMaps maps;
  maps.bytes = masks ? 1 : 0;
  switch (ResolveDepthOrigin(recipe, options, input)) {
    case DepthOrigin::kNetwork: {
      const DepthNetwork& network = input.depth_network;
      for (const ScreenedPhoto& photo : photos) {
        maps.depth[photo.name] = int64_t{network.width} * network.height;
      }
      maps.has_confidence = masks;  // masked pixels have none
      break;
    }
    case DepthOrigin::kStereo: {
      maps.stereo = true;
      const int most = StereoPhotos(recipe, options);
      for (const size_t i : SpreadIndices(photos.size(), most > 0 ? most : photos.size())) {
        const auto [width, height] =
            ShrunkSize(photos[i].width, photos[i].height, StereoOptions().max_side);
        maps.depth[photos[i].name] = int64_t{width} * height;
      }
      break;
    }
    case DepthOrigin::kMaps:
      for (const ScreenedPhoto& photo : photos) {
        const std::string path = FindDepthMap(input.depth_dir, photo.name);
        if (path.empty()) continue;
        maps.depth[photo.name] = ReadDepthSize(path, path).value_or(DepthSize()).pixels();
      }
      break;
    case DepthOrigin::kAuto:
    case DepthOrigin::kNone:
      break;
  }
  return maps;
}

MemoryEstimate EstimateMemory(absl::Span<const ScreenedPhoto> photos,
                              const ReconstructOptions& options, int threads,
                              const PhotoMaps& maps) {
  const Recipe recipe = options.ResolveRecipe();
  double all = 0, depth = 0, largest = 0, largest_file = 0;
  for (const ScreenedPhoto& photo : photos) {
    const PictureSize size = ShrunkSize(photo.width, photo.height, options.max_image_side);
    const double pixels = double(size.width) * size.height;
    all += pixels;
    if (const auto map = maps.depth.find(photo.name); map != maps.depth.end()) {
      depth += DepthPixels(static_cast<double>(map->second), pixels, recipe.coarse_levels);
    }
    largest = std::max(largest, pixels);
    largest_file = std::max(largest_file, double(photo.width) * photo.height);
  }
  const double at_once = std::min<double>(threads, photos.size());
  const bool capture = recipe.tone.rule == Tone::kCapture;
  const double colors =
      capture ? kColorsPixel * largest_file * std::min<double>(at_once, kPhotosOfColors) : 0;
  const double reading = kPhotoPixel * all + kDecodePixel * largest_file * at_once;
  const double targets = capture ? kTargetPixel * largest * at_once : 0;
  const double stereo =
      recipe.dense_start || maps.stereo
          ? std::min<double>(at_once, kStereoViews) * std::min(kStereoView, kStereoPixel * largest)
          : 0;
  double training = kTrainPixel * largest;
  if (recipe.lita && recipe.use_pdm) {
    const double compared =
        recipe.crop_pixels > 0 ? std::min<double>(largest, recipe.crop_pixels) : largest;
    training += PdmPixel(recipe.pdm) * compared;
  }
  MemoryEstimate estimate;
  estimate.reading = static_cast<int64_t>(std::max(colors, reading));
  estimate.photos =
      static_cast<int64_t>((kViewPixel + maps.bytes) * WithPyramid(recipe.coarse_levels) * all +
                           (kDepthPixel + (maps.has_confidence ? kConfidencePixel : 0)) * depth);
  estimate.rims = static_cast<int64_t>(WithPyramid(recipe.coarse_levels) * all);
  estimate.work = static_cast<int64_t>(std::max({training, targets, stereo}));
  estimate.gaussians = static_cast<int64_t>(kGaussian * options.max_gaussians);
  return estimate;
}

absl::Status CheckMemory(absl::Span<const ScreenedPhoto> photos, const ReconstructOptions& options,
                         const PhotoMaps& maps, int64_t bytes) {
  const int64_t least = EstimateMemory(photos, options, ThreadsOf(options), maps).Least();
  if (bytes == 0 || least <= bytes) return absl::OkStatus();
  return MakeError(
      absl::StatusCode::kResourceExhausted, "MEMORY_EXCEEDED", "options.max_image_side",
      absl::StrFormat("%d photos at this size take %s of memory or more with %s, and there are "
                      "%s: %s",
                      photos.size(), GiB(least), Counted(ThreadsOf(options), "thread"), GiB(bytes),
                      Advice(photos, options, maps, bytes)));
}

std::string DescribeMemory(absl::Span<const ScreenedPhoto> photos,
                           const ReconstructOptions& options, const PhotoMaps& maps,
                           int64_t bytes) {
  const absl::Status status = CheckMemory(photos, options, maps, bytes);
  if (!status.ok()) return std::string(status.message());
  const MemoryEstimate estimate = EstimateMemory(photos, options, ThreadsOf(options), maps);
  return absl::StrFormat("a run would take %s to %s of memory%s", GiB(estimate.Least()),
                         GiB(estimate.Most()),
                         bytes == 0 ? "" : absl::StrFormat("; there are %s", GiB(bytes)));
}

}  // namespace litags
