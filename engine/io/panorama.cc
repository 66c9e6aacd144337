#include "engine/io/panorama.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "absl/strings/numbers.h"
#include "engine/io/image_header.h"
#include "engine/io/io_error.h"
#include "engine/io/png_codes.h"

namespace litags {
namespace {

using std::string_view_literals::operator""sv;

constexpr size_t kMetadataBytes = 512 << 10;  // of XMP, and of the head of a JPEG, where it lies
constexpr size_t kValueBytes = 32;            // after the name of a property

// The number that a property of the namespace GPano has, as an attribute or an element; 0: none.
double Number(std::string_view bytes, std::string_view property) {
  const size_t at = bytes.find(property);
  if (at == std::string_view::npos) return 0;
  const std::string_view rest = bytes.substr(at + property.size(), kValueBytes);
  const size_t digits = rest.find_first_of("0123456789");
  double value = 0;
  if (digits == std::string_view::npos || digits > 2 ||  // =" or >
      !absl::SimpleAtod(
          Absl(rest.substr(digits, rest.find_first_not_of("0123456789.", digits) - digits)),
          &value)) {
    return 0;
  }
  return value;
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

// How far a strip's bands are from all of it, in the mean.
double Spread(const std::vector<double>& strip) {
  std::array<double, 3> middle = {};
  for (size_t i = 0; i < strip.size(); ++i) middle[i % 3] += 3 * strip[i] / strip.size();
  double sum = 0;
  for (size_t i = 0; i < strip.size(); ++i) sum += std::abs(strip[i] - middle[i % 3]);
  return sum / static_cast<double>(strip.size());
}

}  // namespace

PanoramaPart WholePanorama(int width, int height) {
  return {static_cast<double>(width), static_cast<double>(height), 0, 0};
}

std::optional<PanoramaPart> StatedPanorama(std::string_view bytes, int width, int height) {
  // In other files it may come behind the picture.
  if (IsJpeg(bytes)) bytes = bytes.substr(0, kMetadataBytes);
  constexpr std::string_view kName = "GPano:ProjectionType";
  const size_t at = bytes.find(kName);
  if (at == std::string_view::npos ||
      bytes.substr(at + kName.size(), kValueBytes).find("equirectangular") ==
          std::string_view::npos) {
    return std::nullopt;
  }
  bytes = bytes.substr(at - std::min(at, kMetadataBytes), 2 * kMetadataBytes);
  const double cut_width = Number(bytes, "GPano:CroppedAreaImageWidthPixels");
  const double cut_height = Number(bytes, "GPano:CroppedAreaImageHeightPixels");
  const double whole_width = Number(bytes, "GPano:FullPanoWidthPixels");
  const double whole_height = Number(bytes, "GPano:FullPanoHeightPixels");
  const bool stated =
      cut_width > 0 && cut_height > 0 && whole_width >= cut_width && whole_height >= cut_height;
  if (!stated) {
    if (width != 2 * height) return std::nullopt;
    return WholePanorama(width, height);
  }
  // The photo may have been made smaller since; rounded sides of the whole are its sides still.
  const auto x = [&](double px) { return width * px / cut_width; };
  const auto y = [&](double px) { return height * px / cut_height; };
  if (std::abs(x(cut_height) / height - 1) > 0.02) return std::nullopt;  // or cut
  return PanoramaPart{x(whole_width), y(whole_height),
                      x(Number(bytes, "GPano:CroppedAreaLeftPixels")),
                      y(Number(bytes, "GPano:CroppedAreaTopPixels"))};
}

std::string WithStatedPanorama(std::string png) {
  // A keyword, not deflated, of no language, and XMP.
  constexpr std::string_view kText(
      "XML:com.adobe.xmp\0\0\0\0\0"
      "<x:xmpmeta xmlns:x=\"adobe:ns:meta/\">"
      "<rdf:RDF xmlns:rdf=\"http://www.w3.org/1999/02/22-rdf-syntax-ns#\">"
      "<rdf:Description rdf:about=\"\" xmlns:GPano=\"http://ns.google.com/photos/1.0/panorama/\""
      " GPano:ProjectionType=\"equirectangular\"/></rdf:RDF></x:xmpmeta>"sv);
  return WithPngChunk(std::move(png), "iTXt", std::string(kText));
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
  // Edges of one colour, as of a thing before black, tell nothing.
  if (Spread(first) < kUnlike * kRounding) return false;
  return around <= kLike * beside + kRounding && elsewhere >= kUnlike * (around + kRounding);
}

}  // namespace litags
