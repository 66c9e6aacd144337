#include "engine/target/white_balance.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "absl/strings/str_format.h"
#include "engine/core/mask.h"
#include "engine/core/quantile.h"

namespace litags {
namespace {

constexpr int kBlock = 4;  // px

// Photos with a good white balance: median and covariance of ChromaticityOf() of 110 photos of all
// kinds (68 of CBSD68, 24 of Kodak, 18 of McMaster). One of them lies 7.9 deviations off and is
// green (IsGreen), all others 4.2 or less; in the light of sodium lamps all lie beyond 5.
constexpr Chromaticity kMean = {0.1048, -0.1927};
constexpr double kRed = 0.0586, kCross = -0.0249, kBlue = 0.1064;
constexpr double kImplausible = 5;  // deviations

using Light = std::array<double, 3>;

// Mean linear light of a block; nothing if it does not count.
std::optional<Light> LightOfBlock(const Photo& photo, const PlaneU8& mask, int left, int top) {
  const LinearTable& linear = LinearTable::Get();
  Light light = {};
  for (int y = top; y < top + kBlock; ++y) {
    for (int x = left; x < left + kBlock; ++x) {
      if (!Counts(mask, x, y)) return std::nullopt;
      const int16_t* pixel = photo.pixel(x, y);
      for (int c = 0; c < 3; ++c) {
        if (pixel[c] >= kTintedSample) return std::nullopt;
        light[c] += linear(pixel[c]) / (kBlock * kBlock);
      }
    }
  }
  // Noise around black may be negative.
  for (double& x : light) x = std::max(x, 0.0);
  return light;
}

double SquaredDeviations(const Chromaticity& d) {
  return (kBlue * d[0] * d[0] - 2 * kCross * d[0] * d[1] + kRed * d[1] * d[1]) /
         (kRed * kBlue - kCross * kCross);
}

// Whether green outshines both red and blue, beside the mean of photos: as foliage, a surface's
// colour. Hot bodies and daylight go from red (red > green > blue) to blue (red < green < blue).
bool IsGreen(const Chromaticity& from_mean) { return from_mean[0] < 0 && from_mean[1] < 0; }

}  // namespace

std::optional<Chromaticity> ChromaticityOf(const Photo& photo, const PlaneU8& mask) {
  Light sums = {};
  for (int y = 0; y + kBlock <= photo.height; y += kBlock) {
    for (int x = 0; x + kBlock <= photo.width; x += kBlock) {
      const std::optional<Light> light = LightOfBlock(photo, mask, x, y);
      if (!light.has_value()) continue;
      for (int c = 0; c < 3; ++c) sums[c] += std::pow((*light)[c], 6);
    }
  }
  if (!(sums[1] > 0)) return std::nullopt;
  const auto log = [&](int c) {
    // A channel without light is log(0).
    return std::clamp(std::log(sums[c] / sums[1]) / 6, -kMostCast, kMostCast);
  };
  return Chromaticity{log(0), log(2)};
}

std::array<double, 3> SceneWhiteBalance(absl::Span<const Chromaticity> chromaticities) {
  Chromaticity from_mean = {};
  for (int k = 0; k < 2; ++k) {
    std::vector<double> logs;
    for (const Chromaticity& c : chromaticities) {
      if (std::isfinite(c[0]) && std::isfinite(c[1])) logs.push_back(c[k]);
    }
    if (logs.empty()) return {1, 1, 1};
    from_mean[k] = Median(std::move(logs)) - kMean[k];
  }
  if (SquaredDeviations(from_mean) < kImplausible * kImplausible || IsGreen(from_mean))
    return {1, 1, 1};
  const auto gain = [](double log) { return std::exp(std::clamp(log, -kMostCast, kMostCast)); };
  return {gain(from_mean[0]), 1, gain(from_mean[1])};
}

std::string DescribeCast(const std::array<double, 3>& cast) {
  if (cast == std::array<double, 3>{1, 1, 1}) return "";
  return absl::StrFormat(
      "the light has a strong cast (red x %.2g, blue x %.2g against green): neutralised; "
      "--white-balance camera keeps it",
      cast[0], cast[2]);
}

}  // namespace litags
