// Compressed PLY: element chunk holds bounds of 256 Gaussians, element vertex four words of each
// Gaussian, element sh a byte of each coefficient above degree 0.
#include <algorithm>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "engine/export/formats.h"
#include "engine/export/near_order.h"
#include "engine/export/quantize.h"
#include "engine/io/byte_reader.h"

namespace litags {
namespace {

constexpr size_t kChunk = 256;
constexpr float kLargestLogScale = 20;
// Bits of x, y, z in a word.
constexpr int kBits[3] = {11, 10, 11};

// Bounds of three values of some Gaussians.
struct Bounds {
  std::array<float, 3> min, max;

  template <typename F>
  Bounds(size_t begin, size_t end, F&& value) {
    for (int k = 0; k < 3; ++k) {
      min[k] = max[k] = value(begin, k);
      for (size_t i = begin + 1; i < end; ++i) {
        min[k] = std::min(min[k], value(i, k));
        max[k] = std::max(max[k], value(i, k));
      }
    }
  }

  double Inside(float value, int k) const {
    return max[k] > min[k] ? (double{value} - min[k]) / (double{max[k]} - min[k]) : 0;
  }
  template <typename F>
  uint32_t Pack(size_t i, F&& value) const {
    uint32_t word = 0;
    for (int k = 0; k < 3; ++k)
      word = word << kBits[k] | PackUnit(Inside(value(i, k), k), kBits[k]);
    return word;
  }
  void Append(std::string* out) const {
    for (float v : min) AppendNumber(out, v);
    for (float v : max) AppendNumber(out, v);
  }
};

uint32_t PackQuat(const std::array<float, 4>& q) {  // wxyz
  const SmallestThree three = DropLargest(q);
  uint32_t word = static_cast<uint32_t>(three.largest);
  for (float v : three.rest) word = word << 10 | PackUnit(v * std::sqrt(0.5) + 0.5, 10);
  return word;
}

std::string Header(const ViewerScene& scene, int coefficients) {
  const size_t count = scene.splats.size();
  std::string out = "ply\nformat binary_little_endian 1.0\n";
  if (scene.origin != std::array<double, 3>{}) {
    absl::StrAppendFormat(&out, "comment origin %.17g %.17g %.17g\n", scene.origin[0],
                          scene.origin[1], scene.origin[2]);
  }
  if (scene.antialiased) absl::StrAppend(&out, "comment antialiased\n");
  absl::StrAppend(&out, "element chunk ", (count + kChunk - 1) / kChunk, "\n");
  for (const char* stem : {"_", "_scale_"}) {
    for (const char* bound : {"min", "max"}) {
      for (const char* axis : {"x", "y", "z"}) {
        absl::StrAppend(&out, "property float ", bound, stem, axis, "\n");
      }
    }
  }
  for (const char* bound : {"min", "max"}) {
    for (const char* channel : {"r", "g", "b"}) {
      absl::StrAppend(&out, "property float ", bound, "_", channel, "\n");
    }
  }
  absl::StrAppend(&out, "element vertex ", count, "\n");
  for (const char* word : {"position", "rotation", "scale", "color"}) {
    absl::StrAppend(&out, "property uint packed_", word, "\n");
  }
  if (coefficients > 0) absl::StrAppend(&out, "element sh ", count, "\n");
  for (int i = 0; i < 3 * coefficients; ++i) {
    absl::StrAppend(&out, "property uchar f_rest_", i, "\n");
  }
  return out + "end_header\n";
}

}  // namespace

absl::StatusOr<std::string> EncodeCompressedPly(const ViewerScene& scene) {
  const Splats& splats = scene.splats;
  const std::vector<uint32_t> order = NearOrder(splats);  // small chunks have small steps
  const auto value = [&](size_t i, int row) { return splats.at(order[i], row); };
  const auto mean = [&](size_t i, int k) { return value(i, kMean + k); };
  const auto log_scale = [&](size_t i, int k) {
    return std::clamp(value(i, kLogScale + k), -kLargestLogScale, kLargestLogScale);
  };
  const auto color = [&](size_t i, int k) {
    return static_cast<float>(0.5 + kSh0 * value(i, kShDc + k));
  };
  std::string chunks, words, rest;
  for (size_t begin = 0; begin < splats.size(); begin += kChunk) {
    const size_t end = std::min(splats.size(), begin + kChunk);
    const Bounds means(begin, end, mean), scales(begin, end, log_scale), colors(begin, end, color);
    for (const Bounds* bounds : {&means, &scales, &colors}) bounds->Append(&chunks);
    for (size_t i = begin; i < end; ++i) {
      AppendNumber(&words, means.Pack(i, mean));
      AppendNumber(&words, PackQuat(UnitQuat(splats, order[i])));
      AppendNumber(&words, scales.Pack(i, log_scale));
      uint32_t rgba = 0;
      for (int k = 0; k < 3; ++k) rgba = rgba << 8 | PackUnit(colors.Inside(color(i, k), k), 8);
      AppendNumber(&words, rgba << 8 | PackUnit(Opacity(splats, order[i]), 8));
    }
  }
  const int coefficients = ShCount(scene.sh_degree) - 1;
  for (size_t i = 0; i < splats.size(); ++i) {
    for (int c = 0; c < 3; ++c) {
      for (int k = 1; k <= coefficients; ++k) {
        const double unit = value(i, ShRow(k, c)) / 8.0 + 0.5;
        rest += static_cast<char>(static_cast<uint8_t>(std::clamp(256 * unit, 0.0, 255.0)));
      }
    }
  }
  return absl::StrCat(Header(scene, coefficients), chunks, words, rest);
}

}  // namespace litags
