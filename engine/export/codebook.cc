#include "engine/export/codebook.h"

#include <algorithm>
#include <numeric>
#include <queue>

namespace litags {
namespace {

constexpr int kRounds = 30;  // of Lloyd's rule; the error hardly falls after 20
constexpr size_t kMostGroups = 65536;

// Sums before each of the sorted values.
std::vector<double> Sums(const std::vector<float>& sorted) {
  std::vector<double> sums(sorted.size() + 1);
  for (size_t i = 0; i < sorted.size(); ++i) sums[i + 1] = sums[i] + sorted[i];
  return sums;
}

// A run of `order` in MakePalette.
struct Group {
  size_t begin, end;
  int axis;       // on which its points differ most
  double spread;  // sum of squares about the centre
  float middle;   // the centre on that axis

  bool operator<(const Group& other) const {
    return spread != other.spread ? spread < other.spread : begin > other.begin;
  }
};

Group Measure(const std::vector<float>& points, int dimensions, const std::vector<uint32_t>& order,
              size_t begin, size_t end) {
  std::vector<double> sum(dimensions), squares(dimensions);
  for (size_t i = begin; i < end; ++i) {
    const float* point = points.data() + size_t{order[i]} * dimensions;
    for (int k = 0; k < dimensions; ++k) {
      sum[k] += point[k];
      squares[k] += double{point[k]} * point[k];
    }
  }
  Group group{begin, end, 0, 0, 0};
  double most = -1;
  const double n = static_cast<double>(end - begin);
  for (int k = 0; k < dimensions; ++k) {
    const double spread = std::max(0.0, squares[k] - sum[k] * sum[k] / n);
    group.spread += spread;
    if (spread > most) {
      most = spread;
      group.axis = k;
      group.middle = static_cast<float>(sum[k] / n);
    }
  }
  return group;
}

}  // namespace

Codebook::Codebook(std::vector<float> values) {
  if (values.empty()) return;
  std::sort(values.begin(), values.end());
  const std::vector<double> sums = Sums(values);
  const size_t n = values.size();
  // Half where the values are, half evenly, so that the few at the ends are not forgotten.
  for (size_t i = 0; i < 128; ++i) {
    values_[2 * i] = values[std::min(n - 1, (2 * i + 1) * n / 256)];
    values_[2 * i + 1] = values.front() + (values.back() - values.front()) * float(i) / 127;
  }
  std::sort(values_.begin(), values_.end());
  for (int round = 0; round < kRounds; ++round) {
    size_t begin = 0;
    for (size_t k = 0; k < 256; ++k) {
      const size_t end = k == 255 ? n
                                  : std::upper_bound(values.begin() + begin, values.end(),
                                                     0.5f * (values_[k] + values_[k + 1])) -
                                        values.begin();
      if (end > begin) values_[k] = static_cast<float>((sums[end] - sums[begin]) / (end - begin));
      begin = end;
    }
    std::sort(values_.begin(), values_.end());  // empty ones stayed
  }
}

uint8_t Codebook::Nearest(float value) const {
  const size_t above = std::lower_bound(values_.begin(), values_.end(), value) - values_.begin();
  if (above == 0) return 0;
  if (above == 256) return 255;
  return static_cast<uint8_t>(value - values_[above - 1] < values_[above] - value ? above - 1
                                                                                  : above);
}

Palette MakePalette(const std::vector<float>& points, int dimensions, size_t count,
                    const CancelToken& cancel) {
  const size_t n = points.size() / dimensions;
  count = std::min(count, kMostGroups);
  std::vector<uint32_t> order(n);
  std::iota(order.begin(), order.end(), 0u);
  std::priority_queue<Group> groups;
  if (n > 0) groups.push(Measure(points, dimensions, order, 0, n));
  while (!groups.empty() && groups.size() < count && groups.top().spread > 0 &&
         !cancel.IsCancelled()) {
    const Group group = groups.top();
    const auto middle = std::stable_partition(
        order.begin() + group.begin, order.begin() + group.end,
        [&](uint32_t i) { return points[size_t{i} * dimensions + group.axis] < group.middle; });
    const size_t at = middle - order.begin();
    groups.pop();
    if (at == group.begin || at == group.end) {  // they differ by rounding only
      groups.push({group.begin, group.end, group.axis, 0, group.middle});
      continue;
    }
    groups.push(Measure(points, dimensions, order, group.begin, at));
    groups.push(Measure(points, dimensions, order, at, group.end));
  }
  // In the order of the points, so that neighbours in the palette are alike.
  std::vector<Group> sorted;
  for (; !groups.empty(); groups.pop()) sorted.push_back(groups.top());
  std::sort(sorted.begin(), sorted.end(),
            [](const Group& a, const Group& b) { return a.begin < b.begin; });
  Palette palette;
  palette.count = sorted.size();
  palette.labels.resize(n);
  for (size_t g = 0; g < sorted.size(); ++g) {
    std::vector<double> sum(dimensions);
    for (size_t i = sorted[g].begin; i < sorted[g].end; ++i) {
      palette.labels[order[i]] = static_cast<uint16_t>(g);
      for (int k = 0; k < dimensions; ++k) sum[k] += points[size_t{order[i]} * dimensions + k];
    }
    for (double s : sum) {
      palette.centers.push_back(static_cast<float>(s / (sorted[g].end - sorted[g].begin)));
    }
  }
  return palette;
}

}  // namespace litags
