#include "engine/stereo/match_image.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "absl/strings/str_cat.h"
#include "engine/core/color.h"
#include "engine/core/error.h"
#include "engine/core/quantile.h"

namespace litags {
namespace {

// Of the mean brightness, under the root: at the black level read noise and rounding take over from
// photon noise, and a bare root would blow them up.
constexpr float kBlack = 0.05f;

constexpr double kBlurPx = 0.6;  // Gaussian, at the matched size. Choice

constexpr float kLuma[3] = {0.2126f, 0.7152f, 0.0722f};  // of linear sRGB (BT.709)

cv::Mat Wrap(Planes* plane) {
  return cv::Mat(plane->height, plane->width, CV_32F, plane->data.data());
}

// Values of `gray` that show no noise, since black or white cut it off: up to `black` if their
// block is flat (photos of a few codes are noisy there), and from `white` on.
struct CutOff {
  float black = 0, white = 0;

  bool Holds(const std::array<float, 4>& block) const {
    constexpr float kFlat = 1e-6f;  // rounding of floats
    const auto [least, most] = std::minmax_element(block.begin(), block.end());
    return *least >= white || (*most <= black && *most - *least <= kFlat);
  }
};

// Deviation of the diagonal Haar coefficients (Donoho and Johnstone 1994) of the blocks that are
// not cut off, however many those are: a torch lights little of a night photo. NoiseEstimate counts
// codes of a picture of [0, 1]; these are roots about 0 with no largest value.
float HaarNoise(const Planes& gray, const CutOff& cut_off) {
  std::vector<float> details;
  for (int y = 0; y + 1 < gray.height; y += 2) {
    for (int x = 0; x + 1 < gray.width; x += 2) {
      const std::array<float, 4> v = {gray.at(0, y, x), gray.at(0, y, x + 1), gray.at(0, y + 1, x),
                                      gray.at(0, y + 1, x + 1)};
      if (!cut_off.Holds(v)) details.push_back(std::abs(v[0] - v[1] - v[2] + v[3]) / 2);
    }
  }
  return DeviationFromMagnitudes(details);
}

}  // namespace

absl::StatusOr<MatchImage> MakeMatchImage(const Photo& photo, const Camera& camera) {
  const LinearTable& linear = LinearTable::Get();
  Planes light(1, photo.height, photo.width);
  double sum = 0;
  for (size_t i = 0; i < light.data.size(); ++i) {
    const int16_t* p = &photo.data[3 * i];
    light.data[i] = kLuma[0] * linear(p[0]) + kLuma[1] * linear(p[1]) + kLuma[2] * linear(p[2]);
    sum += light.data[i];
  }
  MatchImage out;
  out.camera = camera;
  out.gray = Planes(1, camera.height, camera.width);
  try {
    cv::Mat gray = Wrap(&out.gray);
    cv::resize(Wrap(&light), gray, gray.size(), 0, 0, cv::INTER_AREA);
    cv::GaussianBlur(gray, gray, cv::Size(), kBlurPx, kBlurPx, cv::BORDER_REPLICATE);
  } catch (const cv::Exception& e) {
    return MakeError(absl::StatusCode::kInternal, "STEREO_RESIZE", "images",
                     absl::StrCat("cannot shrink a photo for stereo: ", e.what()));
  }
  const float mean = static_cast<float>(sum / light.data.size());
  const float gain = mean > 0 ? 1 / mean : 0;
  const float center = std::sqrt(1 + kBlack);
  const auto root = [&](float v) { return std::sqrt(std::max(0.0f, v * gain + kBlack)) - center; };
  for (float& v : out.gray.data) v = root(v);
  // What 8 bits round to black and to white.
  constexpr double kHalfCode = 0.5 / 255;
  out.noise = HaarNoise(out.gray, {.black = root(LinearFromSrgb(kHalfCode)),
                                   .white = root(LinearFromSrgb(1 - kHalfCode))});
  return out;
}

}  // namespace litags
