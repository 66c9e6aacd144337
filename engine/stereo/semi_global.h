// Semi-global matching: the labels that fit best while neighbours agree (Hirschmueller 2008).
#ifndef LITAGS_ENGINE_STEREO_SEMI_GLOBAL_H_
#define LITAGS_ENGINE_STEREO_SEMI_GLOBAL_H_

#include <cstddef>
#include <cstdint>
#include <vector>

namespace litags {

// Cost of every label at every pixel.
struct CostVolume {
  static constexpr int kLabelMultiple = 16;

  int width = 0, height = 0;
  int labels = 0;             // a multiple of kLabelMultiple; fill those not in use with 255
  std::vector<uint8_t> cost;  // [height, width, labels]

  CostVolume(int w, int h, int used_labels)
      : width(w),
        height(h),
        labels((used_labels + kLabelMultiple - 1) / kLabelMultiple * kLabelMultiple),
        cost(size_t(w) * h * labels, 255) {}
  uint8_t* at(size_t pixel) { return cost.data() + pixel * labels; }
};

struct SmoothnessPenalty {
  int step = 0;              // for a change by one label between neighbours
  int jump = 0;              // for any larger change, >= step; at most 2000
  double edge_contrast = 0;  // brightness difference at which `jump` is halved (never below step)
};

// Sums of path costs [height, width, labels] along 8 directions. `gray` [height, width] is the
// picture whose edges are likely to be the scene's.
std::vector<uint16_t> AggregateCosts(const CostVolume& volume, const float* gray,
                                     const SmoothnessPenalty& penalty);

}  // namespace litags

#endif  // LITAGS_ENGINE_STEREO_SEMI_GLOBAL_H_
