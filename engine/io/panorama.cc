#include "engine/io/panorama.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "engine/core/check.h"

namespace litags {
namespace {

constexpr size_t kMetadataBytes = 512 << 10;  // of the head of a file, where XMP lies
constexpr size_t kValueBytes = 32;            // after the name of a property

// Where a pixel of a view lies in the panorama, px, pixel centres at +0.5.
struct Place {
  double x, y;
};
Place PlaceOf(const PanoramaView& view, int side, int x, int y, int width) {
  const double u = (x + 0.5) / side * 2 - 1, v = (y + 0.5) / side * 2 - 1;  // tangents
  const auto& R = view.R;
  const double dx = R[0] * u + R[1] * v + R[2], dy = R[3] * u + R[4] * v + R[5],
               dz = R[6] * u + R[7] * v + R[8];
  const double longitude = std::atan2(dx, dz), down = std::atan2(dy, std::hypot(dx, dz));
  const double pixels = width / (2 * std::numbers::pi);  // a radian
  return {width / 2.0 + pixels * longitude, width / 4.0 + pixels * down};
}

// Means of a strip of columns in `bands` of its rows, all channels.
std::vector<double> Strip(const Photo& photo, int first, int columns, int bands) {
  std::vector<double> means(static_cast<size_t>(bands) * 3, 0);
  for (int band = 0; band < bands; ++band) {
    const int from = band * photo.height / bands, to = (band + 1) * photo.height / bands;
    for (int y = from; y < to; ++y) {
      for (int x = first; x < first + columns; ++x) {
        for (int c = 0; c < 3; ++c) {
          means[3 * static_cast<size_t>(band) + c] +=
              photo.pixel(x, y)[c] / static_cast<double>((to - from) * columns) / kPhotoCode;
        }
      }
    }
  }
  return means;
}

double MeanDifference(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0;
  for (size_t i = 0; i < a.size(); ++i) sum += std::abs(a[i] - b[i]);
  return sum / static_cast<double>(a.size());
}

}  // namespace

int PanoramaViewSide(int panorama_width) {
  return std::max(2, 2 * static_cast<int>(std::lround(panorama_width / (2 * std::numbers::pi))));
}

bool SaysPanorama(std::string_view bytes) {
  bytes = bytes.substr(0, kMetadataBytes);
  constexpr std::string_view kName = "GPano:ProjectionType";
  const size_t at = bytes.find(kName);
  if (at == std::string_view::npos) return false;
  return bytes.substr(at + kName.size(), kValueBytes).find("equirectangular") !=
         std::string_view::npos;
}

bool IsClosedAround(const Photo& photo) {
  constexpr int kBands = 32, kColumns = 4;
  constexpr double kRounding = 0.1;  // codes: of the means of a strip
  constexpr double kLike = 2;        // as the strips beside each other differ
  constexpr double kUnlike = 4;      // of these: what is elsewhere
  if (photo.width != 2 * photo.height || photo.height < 2 * kBands) return false;
  const auto strip = [&](int x) { return Strip(photo, x, kColumns, kBands); };
  const int last = photo.width - kColumns;
  const std::vector<double> first = strip(0), end = strip(last);
  const double beside =
      (MeanDifference(first, strip(kColumns)) + MeanDifference(end, strip(last - kColumns))) / 2;
  const double around = MeanDifference(first, end);
  double elsewhere = 0;
  for (const int quarter : {1, 2, 3}) {
    elsewhere += MeanDifference(first, strip(quarter * photo.width / 4)) / 3;
  }
  return around <= kLike * beside + kRounding && elsewhere >= kUnlike * (around + kRounding);
}

Photo CutPanoramaView(const Photo& panorama, const PanoramaView& view) {
  LITAGS_CHECK(!panorama.empty());
  const int width = panorama.width, side = PanoramaViewSide(width);
  Photo out(side, side);
  for (int y = 0; y < side; ++y) {
    for (int x = 0; x < side; ++x) {
      const Place place = PlaceOf(view, side, x, y, width);
      const double left = std::floor(place.x - 0.5), top = std::floor(place.y - 0.5);
      const auto wx = static_cast<float>(place.x - 0.5 - left);
      const auto wy = static_cast<float>(place.y - 0.5 - top);
      // Around the sphere, and up to its poles.
      const int x0 = (static_cast<int>(left) + width) % width, x1 = (x0 + 1) % width;
      const int y0 = std::clamp(static_cast<int>(top), 0, panorama.height - 1);
      const int y1 = std::clamp(static_cast<int>(top) + 1, 0, panorama.height - 1);
      for (int c = 0; c < 3; ++c) {
        const float above = panorama.pixel(x0, y0)[c] * (1 - wx) + panorama.pixel(x1, y0)[c] * wx;
        const float below = panorama.pixel(x0, y1)[c] * (1 - wx) + panorama.pixel(x1, y1)[c] * wx;
        out.pixel(x, y)[c] = NearestSample(above * (1 - wy) + below * wy);
      }
    }
  }
  return out;
}

PlaneU8 CutPanoramaView(const PlaneU8& mask, const PanoramaView& view) {
  const int side = PanoramaViewSide(mask.width);
  PlaneU8 out(side, side);
  for (int y = 0; y < side; ++y) {
    for (int x = 0; x < side; ++x) {
      const Place place = PlaceOf(view, side, x, y, mask.width);
      const int from_x = std::clamp(static_cast<int>(place.x), 0, mask.width - 1);
      const int from_y = std::clamp(static_cast<int>(place.y), 0, mask.height - 1);
      out.data[static_cast<size_t>(y) * side + x] =
          mask.data[static_cast<size_t>(from_y) * mask.width + from_x];
    }
  }
  return out;
}

}  // namespace litags
