#include "engine/train/nan_recovery.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "engine/render/renderer.h"

namespace litags {
namespace {

struct Range {
  int first;  // row or plane where it begins
  const char* name;
};

// The last range that begins at or before `at`.
template <size_t n>
const char* NameAt(const Range (&ranges)[n], int at) {
  const Range* found = &ranges[0];
  for (const Range& range : ranges) {
    if (range.first <= at) found = &range;
  }
  return found->name;
}

constexpr Range kRows[] = {{kMean, "mean"},           {kLogScale, "scale"},
                           {kRawQuat, "rotation"},    {kLogitOpacity, "opacity"},
                           {kShDc, "colour"},         {kDepth, "depth"},
                           {kStructure, "structure"}, {kNoise, "noise"},
                           {kIllumination, "light"},  {kShRest, "view-dependent colour"}};

constexpr Range kChannels[] = {{kChannelColor, "colour"},
                               {kChannelDepth, "depth"},
                               {kChannelStructure, "structure"},
                               {kChannelIllumination, "light"},
                               {kChannelNoise, "noise"}};

}  // namespace

void UpdateBlockOrHide(const AdamStep& step, const float* grads, uint32_t visible, size_t block,
                       SplatState* state) {
  alignas(64) float before[Splats::kBlockFloats];
  std::copy_n(state->params.block(block), Splats::kBlockFloats, before);
  const uint32_t bad = AdamUpdateBlock(step, grads, visible, block, &state->params, &state->moment1,
                                       &state->moment2);
  for (int lane = 0; lane < kSplatBlock; ++lane) {
    if ((bad >> lane & 1) == 0) continue;
    for (int row = 0; row < kSplatRows; ++row) {
      const int at = row * kSplatBlock + lane;
      state->params.block(block)[at] = row == kLogitOpacity ? kInvisibleLogit : before[at];
      state->moment1.block(block)[at] = 0;
      state->moment2.block(block)[at] = 0;
    }
  }
}

std::string NameOfNotFinite(const SplatState& state, size_t gaussian) {
  for (int row = 0; row < kSplatRows; ++row) {
    if (std::isfinite(state.params.at(gaussian, row)) &&
        std::isfinite(state.moment2.at(gaussian, row))) {
      continue;
    }
    return absl::StrCat(NameAt(kRows, row), " of Gaussian ", gaussian);
  }
  return absl::StrCat("Gaussian ", gaussian);
}

std::string PixelsNotFinite(const Planes& channels, const PixelRect& crop, int shrink) {
  for (int c = 0; c < channels.channels; ++c) {
    const float* plane = channels.plane(c);
    const float* end = plane + channels.plane_size();
    const auto bad = [](float v) { return !std::isfinite(v); };
    const float* first = std::find_if(plane, end, bad);
    if (first == end) continue;
    const auto at = static_cast<int>(first - plane);
    return absl::StrCat(NameAt(kChannels, c), " in ", std::count_if(first, end, bad),
                        " px, first at (", shrink * (crop.x + at % channels.width), ", ",
                        shrink * (crop.y + at / channels.width), ")");
  }
  return "";
}

}  // namespace litags
