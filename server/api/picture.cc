#include "server/api/picture.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "engine/core/error.h"
#include "engine/io/image_io.h"

namespace litags {
namespace {

constexpr int kDefaultJpegQuality = 92;

struct Range {
  float min = 0, max = 1;
};

// The values that become the darkest and the brightest code.
Range RangeOf(const Planes& planes, Channel channel) {
  Range found{INFINITY, -INFINITY};
  for (const float v : planes.data) {
    if (!std::isfinite(v)) continue;
    found.min = std::min(found.min, v);
    found.max = std::max(found.max, v);
  }
  if (found.min > found.max) return {};  // no finite value
  switch (channel) {
    case Channel::kDepth:
      return found;
    case Channel::kIllumination:
      return {0, std::max(found.max, 0.0f)};
    case Channel::kNoise: {
      const float m = std::max(std::abs(found.min), std::abs(found.max));
      return {-m, m};
    }
    default:
      return {};
  }
}

// Values of the range to [0, 1]; an empty range becomes black.
Planes Normalized(Planes planes, const Range& range) {
  const float scale = range.max > range.min ? 1.0f / (range.max - range.min) : 0.0f;
  for (float& v : planes.data) v = (v - range.min) * scale;
  return planes;
}

// [C, H, W] to the bytes of [H, W, C].
std::string Interleaved(const Planes& planes) {
  static_assert(std::endian::native == std::endian::little);
  const size_t channels = planes.channels, pixels = planes.plane_size();
  std::string bytes(planes.data.size() * sizeof(float), '\0');
  for (size_t c = 0; c < channels; ++c) {
    for (size_t i = 0; i < pixels; ++i) {
      std::memcpy(&bytes[(i * channels + c) * sizeof(float)], &planes.plane(c)[i], sizeof(float));
    }
  }
  return bytes;
}

absl::StatusOr<std::string> EncodeCodes(const Planes& planes, Channel channel,
                                        v1::PictureFormat format, int jpeg_quality) {
  if (format == v1::PICTURE_FORMAT_JPEG) {
    return EncodeJpeg(ToImageU8(planes), jpeg_quality ? jpeg_quality : kDefaultJpegQuality);
  }
  if (channel == Channel::kDepth) return EncodePng16(planes);
  return EncodePng(ToImageU8(planes));
}

}  // namespace

absl::Status EncodePicture(const Planes& planes, Channel channel, v1::PictureFormat format,
                           int jpeg_quality, v1::RenderedView* view) {
  view->set_width(planes.width);
  view->set_height(planes.height);
  view->set_planes(planes.channels);
  if (format == v1::PICTURE_FORMAT_RAW_FLOAT) {
    view->set_data(Interleaved(planes));
    return absl::OkStatus();
  }
  const Range range = RangeOf(planes, channel);
  view->set_value_min(range.min);
  view->set_value_max(range.max);
  LITAGS_ASSIGN_OR_RETURN(*view->mutable_data(),
                          EncodeCodes(Normalized(planes, range), channel, format, jpeg_quality));
  return absl::OkStatus();
}

}  // namespace litags
