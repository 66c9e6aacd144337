#include <cmath>
#include <cstdio>
#include <vector>

#include "engine/export/quantize.h"
#include "engine/export/readers.h"
#include "engine/io/byte_reader.h"

namespace litags {
namespace {

constexpr size_t kChunk = 256;

struct Bounds {
  float min[3], max[3];

  bool Read(ByteReader* reader) {
    for (float* bound : {min, max}) {
      for (int k = 0; k < 3; ++k) {
        if (!reader->Read(&bound[k])) return false;
      }
    }
    return true;
  }
  float At(int k, double t) const {
    return static_cast<float>(min[k] + t * (double{max[k]} - min[k]));
  }
};

double Part(uint32_t word, int k) {
  constexpr int kShift[3] = {21, 11, 0}, kBits[3] = {11, 10, 11};
  return UnpackUnit(word >> kShift[k], kBits[k]);
}

std::array<float, 4> UnpackQuat(uint32_t word) {
  SmallestThree three{static_cast<int>(word >> 30), {}};
  for (int k = 0; k < 3; ++k) {
    three.rest[k] =
        static_cast<float>((UnpackUnit(word >> (20 - 10 * k), 10) - 0.5) * std::sqrt(2.0));
  }
  return AddLargest(three);
}

// Count of an element, 0 if it is not there.
size_t CountOf(std::string_view header, std::string_view element) {
  const size_t at = header.find("element " + std::string(element) + " ");
  unsigned long count = 0;
  if (at != std::string_view::npos) {
    std::sscanf(std::string(header.substr(at + 9 + element.size(), 20)).c_str(), "%lu", &count);
  }
  return count;
}

}  // namespace

absl::StatusOr<ViewerScene> DecodeCompressedPly(std::string_view bytes) {
  constexpr std::string_view kEnd = "end_header\n";
  const size_t end = bytes.find(kEnd);
  if (end == std::string_view::npos) return Corrupt("a compressed .ply without a header");
  const std::string_view header = bytes.substr(0, end);
  size_t rest = 0;
  for (size_t at = 0; (at = header.find("uchar f_rest_", at)) != header.npos; ++at) ++rest;
  const size_t count = CountOf(header, "vertex");
  ByteReader reader(bytes.substr(end + kEnd.size()));
  std::vector<std::array<Bounds, 3>> chunks((count + kChunk - 1) / kChunk);
  for (auto& chunk : chunks) {
    for (Bounds& bounds : chunk) {
      if (!bounds.Read(&reader)) return Corrupt("a compressed .ply ends early");
    }
  }
  ViewerScene scene;
  scene.antialiased = header.find("\ncomment antialiased\n") != header.npos;
  if (const size_t at = header.find("\ncomment origin "); at != header.npos) {
    std::sscanf(std::string(header.substr(at, 100)).c_str(), "\ncomment origin %lf %lf %lf",
                &scene.origin[0], &scene.origin[1], &scene.origin[2]);
  }
  scene.splats.Resize(count);
  while (scene.sh_degree > 0 && 3 * (ShCount(scene.sh_degree) - 1) != static_cast<int>(rest)) {
    --scene.sh_degree;
  }
  for (size_t i = 0; i < count; ++i) {
    uint32_t position, rotation, size, color;
    if (!reader.Read(&position) || !reader.Read(&rotation) || !reader.Read(&size) ||
        !reader.Read(&color)) {
      return Corrupt("a compressed .ply ends early");
    }
    const auto& [means, scales, colors] = chunks[i / kChunk];
    for (int k = 0; k < 3; ++k) {
      scene.splats.at(i, kMean + k) = means.At(k, Part(position, k));
      scene.splats.at(i, kLogScale + k) = scales.At(k, Part(size, k));
      const float value = colors.At(k, UnpackUnit(color >> (24 - 8 * k), 8));
      scene.splats.at(i, kShDc + k) = static_cast<float>((value - 0.5) / kSh0);
    }
    SetQuat(&scene.splats, i, UnpackQuat(rotation));
    SetOpacity(&scene.splats, i, UnpackUnit(color, 8));
  }
  const int coefficients = ShCount(scene.sh_degree) - 1;
  for (size_t i = 0; i < count; ++i) {
    for (int at = 0; at < 3 * coefficients; ++at) {
      uint8_t code;
      if (!reader.Read(&code)) return Corrupt("a compressed .ply ends early");
      scene.splats.at(i, ShRow(1 + at % coefficients, at / coefficients)) =
          static_cast<float>(8 * ((code + 0.5) / 256 - 0.5));
    }
  }
  return scene;
}

}  // namespace litags
