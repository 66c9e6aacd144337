#include "engine/tools/bench/exposure_scene.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "absl/strings/str_cat.h"
#include "engine/core/color.h"
#include "engine/core/error.h"
#include "engine/core/photo.h"
#include "engine/io/image_io.h"
#include "engine/target/tone.h"
#include "engine/tools/evaluation/test_view.h"

namespace litags {
namespace {

constexpr int kSpacing = 4;                // px, of the pixels that are compared
constexpr double kLeast = -6, kMost = 14;  // stops
constexpr double kPrecision = 0.01;        // stops

// Samples of a photo and of its truth: linear light and codes of [0, 1].
struct Pair {
  float light, code;
};

absl::Status AddPairs(const Photo& photo, const Photo& truth, const std::string& name,
                      std::vector<Pair>* pairs) {
  if (photo.width != truth.width || photo.height != truth.height) {
    return InvalidInput("SIZE_MISMATCH", name,
                        absl::StrCat(name, ": the photo and its truth differ in size"));
  }
  const LinearTable& linear = LinearTable::Get();
  for (int y = 0; y < photo.height; y += kSpacing) {
    for (int x = 0; x < photo.width; x += kSpacing) {
      const int16_t* pixel = photo.pixel(x, y);
      if (std::max({pixel[0], pixel[1], pixel[2]}) >= kTintedSample) continue;
      for (int c = 0; c < 3; ++c) {
        pairs->push_back({linear(pixel[c]), EncodedOf(truth.pixel(x, y)[c])});
      }
    }
  }
  return absl::OkStatus();
}

double SquaredError(const std::vector<Pair>& pairs, double stops) {
  const auto gain = static_cast<float>(std::exp2(stops));
  double sum = 0;
  for (const Pair& pair : pairs) {
    const double code = SrgbFromLinear(std::clamp(gain * pair.light, 0.0f, 1.0f));
    sum += (code - pair.code) * (code - pair.code);
  }
  return sum;
}

// Where the error is least: whole stops first, then thirds of what is left.
double BestStops(const std::vector<Pair>& pairs) {
  double best = kLeast, least = std::numeric_limits<double>::infinity();
  for (double stops = kLeast; stops <= kMost; stops += 1) {
    if (const double error = SquaredError(pairs, stops); error < least) {
      best = stops;
      least = error;
    }
  }
  double low = best - 1, high = best + 1;
  while (high - low > kPrecision) {
    const double third = (high - low) / 3;
    if (SquaredError(pairs, low + third) < SquaredError(pairs, high - third)) {
      high -= third;
    } else {
      low += third;
    }
  }
  return (low + high) / 2;
}

}  // namespace

absl::StatusOr<double> ExposureErrorOfScene(const std::string& scene, const std::string& light) {
  const std::string folder = absl::StrCat(scene, "/", light), truth = scene + "/high";
  LITAGS_ASSIGN_OR_RETURN(const std::vector<std::string> names, ListPhotos(folder, "scene"));
  std::vector<Photo> photos;
  std::vector<Pair> pairs;
  for (const std::string& name : names) {
    const absl::StatusOr<std::string> normal_path = FindPhoto(truth, name);
    if (!normal_path.ok()) continue;
    LITAGS_ASSIGN_OR_RETURN(Photo photo, ReadPhoto(absl::StrCat(folder, "/", name), name));
    LITAGS_ASSIGN_OR_RETURN(const Photo normal, ReadPhoto(*normal_path, name));
    LITAGS_RETURN_IF_ERROR(AddPairs(photo, normal, name, &pairs));
    photos.push_back(std::move(photo));
  }
  if (photos.empty()) {
    return InvalidInput("NO_PAIRS", "scene",
                        absl::StrCat(truth, " has no photo of ", folder, " by name"));
  }
  const std::vector<double> exposures(photos.size(), 1.0);
  return std::log2(CaptureGain(photos, exposures, /*threads=*/0)) - BestStops(pairs);
}

}  // namespace litags
