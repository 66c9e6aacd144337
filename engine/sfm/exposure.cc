#include "engine/sfm/exposure.h"

#include <algorithm>
#include <cstdint>

#include "engine/core/mask.h"
#include "engine/enhance/enhance.h"
#include "opencv2/core.hpp"
#include "opencv2/imgproc.hpp"

namespace litags {
namespace {

constexpr double kTargetMean = 0.45;
constexpr double kMaxGain = 255;  // one code of a black photo becomes white

void ApplyGain(ImageU8& image, const PlaneU8& mask) {
  const double mean = MeasureLight(image, mask).mean_level;
  const double gain = std::clamp(kTargetMean / std::max(mean, 1e-6), 1.0, kMaxGain);
  for (uint8_t& code : image.data) {
    code = static_cast<uint8_t>(std::min(255.0, code * gain + 0.5));
  }
}

void ApplyBlur(ImageU8& image, double sigma_px) {
  cv::Mat view(image.height, image.width, CV_8UC3, image.data.data());
  cv::GaussianBlur(view, view, cv::Size(), sigma_px);
}

}  // namespace

std::string_view ExposureName(Exposure exposure) {
  switch (exposure) {
    case Exposure::kNormal:
      return "normal";
    case Exposure::kLow:
      return "low";
    case Exposure::kOver:
      return "over";
  }
  return "";
}

LightStats MeasureLight(const ImageU8& photo, const PlaneU8& mask) {
  const size_t pixels = photo.data.size() / 3;
  const double n = 3.0 * CountedPixels(mask, pixels);
  if (n == 0) return {};
  uint64_t sum = 0, clipped = 0;
  ForCounted(mask, pixels, [&](size_t i) {
    for (int c = 0; c < 3; ++c) {
      sum += photo.data[3 * i + c];
      clipped += photo.data[3 * i + c] == 255;
    }
  });
  return {.mean_level = sum / n / 255, .clipped_fraction = clipped / n};
}

Exposure ClassifyExposure(const LightStats& stats) {
  if (stats.mean_level < 0.25) return Exposure::kLow;
  if (stats.mean_level > 0.70 || stats.clipped_fraction > 0.25) return Exposure::kOver;
  return Exposure::kNormal;
}

std::string_view PreparationName(Preparation preparation) {
  switch (preparation) {
    case Preparation::kRaw:
      return "as they are";
    case Preparation::kGainBlur07:
      return "gain + Gaussian 0.7 px";
    case Preparation::kGainBlur12:
      return "gain + Gaussian 1.2 px";
    case Preparation::kGainClahe:
      return "gain + CLAHE";
    case Preparation::kClahe:
      return "CLAHE";
  }
  return "";
}

std::vector<Preparation> Ladder(Exposure exposure) {
  switch (exposure) {
    case Exposure::kLow:
      return {Preparation::kGainBlur07, Preparation::kGainBlur12, Preparation::kGainClahe};
    case Exposure::kOver:
      return {Preparation::kClahe, Preparation::kRaw};
    case Exposure::kNormal:
      return {Preparation::kRaw, Preparation::kClahe};
  }
  return {};
}

ImageU8 Prepare(const ImageU8& photo, Preparation preparation, const PlaneU8& mask) {
  ImageU8 image = photo;
  switch (preparation) {
    case Preparation::kRaw:
      break;
    case Preparation::kGainBlur07:
      ApplyGain(image, mask);
      ApplyBlur(image, 0.7);
      break;
    case Preparation::kGainBlur12:
      ApplyGain(image, mask);
      ApplyBlur(image, 1.2);
      break;
    case Preparation::kGainClahe:
      ApplyGain(image, mask);
      image = EnhanceClahe(image);
      break;
    case Preparation::kClahe:
      image = EnhanceClahe(image);
      break;
  }
  return image;
}

}  // namespace litags
