// The median of a photo's samples by counting: to sort them takes seconds where photos are large.
#ifndef LITAGS_ENGINE_TARGET_SAMPLE_COUNTS_H_
#define LITAGS_ENGINE_TARGET_SAMPLE_COUNTS_H_

#include <cstddef>
#include <cstdint>
#include <numeric>
#include <vector>

namespace litags {

class SampleCounts {
 public:
  SampleCounts() : counts_(65536) {}

  void Add(int16_t sample) { ++counts_[sample - kLeast]; }

  // The upper of the two in the middle if there are two. 0 of none.
  int16_t Median() const {
    const size_t total = std::accumulate(counts_.begin(), counts_.end(), size_t{0});
    if (total == 0) return 0;
    int place = 0;
    for (size_t below = counts_[0]; below <= total / 2; below += counts_[++place]) {
    }
    return static_cast<int16_t>(kLeast + place);
  }

 private:
  static constexpr int kLeast = -32768;
  std::vector<uint32_t> counts_;  // by sample - kLeast
};

}  // namespace litags

#endif  // LITAGS_ENGINE_TARGET_SAMPLE_COUNTS_H_
