// .splat: position and size as floats, colour, opacity and rotation as bytes.
#include <algorithm>
#include <numeric>

#include "engine/export/formats.h"
#include "engine/export/quantize.h"
#include "engine/io/byte_reader.h"

namespace litags {

absl::StatusOr<std::string> EncodeSplat(const ViewerScene& scene) {
  const Splats& splats = scene.splats;
  std::vector<double> seen(splats.size());
  std::vector<size_t> order(splats.size());
  std::iota(order.begin(), order.end(), size_t{0});
  for (size_t i = 0; i < splats.size(); ++i) {
    double log_volume = 0;
    for (int k = 0; k < 3; ++k) log_volume += splats.at(i, kLogScale + k);
    seen[i] = log_volume + std::log(double{Opacity(splats, i)} + 1e-30);
  }
  // Viewers show the file while it comes.
  std::stable_sort(order.begin(), order.end(),
                   [&](size_t a, size_t b) { return seen[a] > seen[b]; });
  std::string out;
  out.reserve(32 * splats.size());
  for (size_t i : order) {
    for (int k = 0; k < 3; ++k) AppendNumber(&out, splats.at(i, kMean + k));
    for (int k = 0; k < 3; ++k) AppendNumber(&out, std::exp(splats.at(i, kLogScale + k)));
    for (int k = 0; k < 3; ++k) {
      AppendNumber(&out, PackByte(255 * (0.5 + kSh0 * splats.at(i, kShDc + k))));
    }
    AppendNumber(&out, PackByte(255 * Opacity(splats, i)));
    for (float v : UnitQuat(splats, i)) AppendNumber(&out, PackByte(128 * v + 128));
  }
  return out;
}

}  // namespace litags
