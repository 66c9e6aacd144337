#include "engine/pipeline/photo_detail.h"

#include <algorithm>
#include <numbers>
#include <opencv2/imgproc.hpp>

#include "engine/noise/noise_estimate.h"

namespace litags {
namespace {

constexpr int kFine = 2, kCoarse = 8;     // of its pixels a side, that one is the mean of
constexpr double kNarrow = 1, kWide = 2;  // px, deviations of the two blurs whose difference counts

constexpr double kMost = 1000;            // of a ratio; they are compared with small ones
constexpr int kLeastSide = 16 * kCoarse;  // px; smaller ones say too little

// Sharp photos of 19 captures have 0.54 of their capture's middle or more. Blurs of 5 px of 640
// leave 0.21 to 0.25 of it, of 8 px 0.08 to 0.11 (docs/experiments/reported-troubles.md).
constexpr double kBlurred = 0.3;
// The least of 110 well exposed photos.
constexpr double kLeastSharp = 0.2;
// Twice the least of those photos.
constexpr double kPlain = 0.001;

// Variance of a picture, shrunk by `factor`, in the band between the two blurs.
double BandVariance(const cv::Mat& luma, int factor) {
  cv::Mat small, narrow, wide;
  cv::resize(luma, small, cv::Size(), 1.0 / factor, 1.0 / factor, cv::INTER_AREA);
  cv::GaussianBlur(small, narrow, {}, kNarrow, kNarrow, cv::BORDER_REFLECT);
  cv::GaussianBlur(small, wide, {}, kWide, kWide, cv::BORDER_REFLECT);
  const cv::Mat band = narrow - wide;
  return band.dot(band) / static_cast<double>(band.total());
}

// The same of white noise of variance 1, by Parseval: the integral of (G_a - G_b)^2.
double BandOfNoise(int factor) {
  const double a = kNarrow * kNarrow, b = kWide * kWide;
  return (1 / (4 * a) + 1 / (4 * b) - 1 / (a + b)) / std::numbers::pi / (factor * factor);
}

}  // namespace

PhotoDetail DetailOf(const Planes& picture) {
  if (std::min(picture.width, picture.height) < kLeastSide) return {};
  const cv::Mat luma(picture.height, picture.width, CV_32F,
                     const_cast<float*>(picture.data.data()));
  const double noise =
      NoiseOfChannel(picture.data.data(), picture.width, picture.height, {}, kBelowWhite)
          .Deviation() /
      255;
  const auto detail = [&](int factor) {
    return std::max(0.0, BandVariance(luma, factor) - noise * noise * BandOfNoise(factor));
  };
  const double fine = detail(kFine), coarse = detail(kCoarse), mean = cv::mean(luma)[0];
  if (!(coarse > 0 && mean > 0)) return {};
  return {.fine = std::min(fine / coarse, kMost),
          .coarse = std::min(coarse / (mean * mean), kMost)};
}

bool IsBlurred(const PhotoDetail& photo, double middle) {
  return photo.coarse > kPlain && photo.fine < kLeastSharp && photo.fine < kBlurred * middle;
}

}  // namespace litags
