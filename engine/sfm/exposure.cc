#include "engine/sfm/exposure.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "engine/core/mask.h"
#include "engine/enhance/enhance.h"
#include "opencv2/core.hpp"
#include "opencv2/imgproc.hpp"

namespace litags {
namespace {

constexpr double kTargetMean = 0.45;
constexpr double kMaxGain = 1024;  // two bits below an 8-bit code

void ApplyGain(const PlaneU8& mask, Photo* photo) {
  const double mean = MeasureLight(*photo, mask).mean_level;
  const double gain = std::clamp(kTargetMean / std::max(mean, 1e-6), 1.0, kMaxGain);
  for (int16_t& sample : photo->data) {
    sample = static_cast<int16_t>(std::clamp<double>(std::round(sample * gain), 0, kPhotoWhite));
  }
}

void Blur(double sigma_px, Photo* photo) {
  cv::Mat view(photo->height, photo->width, CV_16SC3, photo->data.data());
  cv::GaussianBlur(view, view, cv::Size(), sigma_px);
}

}  // namespace

LightStats MeasureLight(const Photo& photo, const PlaneU8& mask) {
  const double n = 3.0 * CountedPixels(mask, photo.pixels());
  if (n == 0) return {};
  int64_t sum = 0, clipped = 0;
  ForCounted(mask, photo.pixels(), [&](size_t i) {
    for (int c = 0; c < 3; ++c) {
      sum += photo.data[3 * i + c];
      clipped += photo.data[3 * i + c] >= kClippedSample;
    }
  });
  return {.mean_level = std::max(0.0, sum / n / kPhotoWhite), .clipped_fraction = clipped / n};
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

ImageU8 Prepare(const Photo& photo, Preparation preparation, const PlaneU8& mask) {
  Photo image = photo;
  switch (preparation) {
    case Preparation::kRaw:
      break;
    case Preparation::kGainBlur07:
      ApplyGain(mask, &image);
      Blur(0.7, &image);
      break;
    case Preparation::kGainBlur12:
      ApplyGain(mask, &image);
      Blur(1.2, &image);
      break;
    case Preparation::kGainClahe:
      ApplyGain(mask, &image);
      return EnhanceClahe(PhotoToU8(image));
    case Preparation::kClahe:
      return EnhanceClahe(PhotoToU8(image));
  }
  return PhotoToU8(image);
}

}  // namespace litags
