#include "engine/export/point_cloud.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "engine/io/byte_reader.h"

namespace litags {
namespace {

// Offsets and sizes of LAS 1.2's header and of a point of format 2, bytes.
constexpr uint16_t kLasHeader = 227, kLasPoint = 26;
constexpr uint8_t kOnlyReturn = 0x09;  // the first of one

// Padded with zeros.
void AppendText(std::string* out, std::string text, size_t size) {
  text.resize(size);
  *out += text;
}

std::string LasHeader(const Box& bounds, double scale, uint32_t points) {
  std::string out = "LASF";
  out.append(20, '\0');  // source, encoding, project
  AppendNumber<uint8_t>(&out, 1);
  AppendNumber<uint8_t>(&out, 2);
  AppendText(&out, "EXTRACTION", 32);
  AppendText(&out, "litags", 32);
  AppendNumber<uint32_t>(&out, 0);  // day and year: not known to the same scene's next file
  AppendNumber<uint16_t>(&out, kLasHeader);
  AppendNumber<uint32_t>(&out, kLasHeader);  // where the points are
  AppendNumber<uint32_t>(&out, 0);           // records before them
  AppendNumber<uint8_t>(&out, 2);
  AppendNumber<uint16_t>(&out, kLasPoint);
  AppendNumber<uint32_t>(&out, points);
  for (const uint32_t of_return : {points, 0u, 0u, 0u, 0u}) AppendNumber(&out, of_return);
  for (int k = 0; k < 3; ++k) AppendNumber<double>(&out, scale);
  for (int k = 0; k < 3; ++k) AppendNumber<double>(&out, bounds.min[k]);
  for (int k = 0; k < 3; ++k) {
    AppendNumber<double>(&out, bounds.max[k]);
    AppendNumber<double>(&out, bounds.min[k]);
  }
  return out;
}

}  // namespace

Box BoundsOf(const PointCloud& points) {
  Box box = {points[0].xyz, points[0].xyz};
  for (const ColoredPoint& point : points) {
    for (int k = 0; k < 3; ++k) {
      box.min[k] = std::min(box.min[k], point.xyz[k]);
      box.max[k] = std::max(box.max[k], point.xyz[k]);
    }
  }
  return box;
}

std::string PlyVertexHeader(size_t count) {
  return absl::StrCat("ply\nformat binary_little_endian 1.0\nelement vertex ", count,
                      "\nproperty double x\nproperty double y\nproperty double z\n"
                      "property uchar red\nproperty uchar green\nproperty uchar blue\n");
}

void AppendPlyVertices(const PointCloud& points, std::string* out) {
  for (const ColoredPoint& point : points) {
    for (const double x : point.xyz) AppendNumber(out, x);
    for (const uint8_t code : point.rgb) AppendNumber(out, code);
  }
}

std::string EncodePointsPly(const PointCloud& points) {
  std::string out = PlyVertexHeader(points.size()) + "end_header\n";
  AppendPlyVertices(points, &out);
  return out;
}

std::string EncodeLas(const PointCloud& points) {
  const Box bounds = BoundsOf(points);
  const double side = std::max(bounds.LongestSide(), 1e-30);
  const double scale = std::pow(10.0, std::ceil(std::log10(std::ldexp(side, -30))));
  std::string out = LasHeader(bounds, scale, static_cast<uint32_t>(points.size()));
  for (const ColoredPoint& point : points) {
    for (int k = 0; k < 3; ++k) {
      AppendNumber(&out, static_cast<int32_t>(std::lround((point.xyz[k] - bounds.min[k]) / scale)));
    }
    AppendNumber<uint16_t>(&out, 0);  // intensity
    AppendNumber<uint8_t>(&out, kOnlyReturn);
    out.append(5, '\0');  // class, angle, user's byte, source
    for (const uint8_t code : point.rgb) AppendNumber<uint16_t>(&out, uint16_t{257} * code);
  }
  return out;
}

}  // namespace litags
