// Points of surfaces with their colours, and the files that hold them.
#ifndef LITAGS_ENGINE_EXPORT_POINT_CLOUD_H_
#define LITAGS_ENGINE_EXPORT_POINT_CLOUD_H_

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "engine/export/export_request.h"

namespace litags {

struct ColoredPoint {
  std::array<double, 3> xyz;
  std::array<uint8_t, 3> rgb;  // sRGB
};
using PointCloud = std::vector<ColoredPoint>;

// The smallest box that holds the points. Not empty.
Box BoundsOf(const PointCloud& points);

// The header of a binary .ply up to its vertices, without "end_header", and their bytes.
std::string PlyVertexHeader(size_t count);
void AppendPlyVertices(const PointCloud& points, std::string* out);

// .ply: coordinates in doubles, colours in bytes.
std::string EncodePointsPly(const PointCloud& points);

// ASPRS LAS 1.2, point format 2: coordinates in 32 bits, in units of the least power of ten from a
// 2^30th of the largest side on; colours in 16 bits. Not empty.
std::string EncodeLas(const PointCloud& points);

}  // namespace litags

#endif  // LITAGS_ENGINE_EXPORT_POINT_CLOUD_H_
