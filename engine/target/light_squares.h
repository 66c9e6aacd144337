// A photo's light in small squares: single pixels of dark photos are mostly noise.
#ifndef LITAGS_ENGINE_TARGET_LIGHT_SQUARES_H_
#define LITAGS_ENGINE_TARGET_LIGHT_SQUARES_H_

#include <algorithm>
#include <array>

#include "engine/core/color.h"
#include "engine/core/mask.h"
#include "engine/core/photo.h"

namespace litags {

inline constexpr int kSquare = 4;  // px, the side

struct LightSquare {
  int x = 0, y = 0;                     // its first pixel
  int counted = 0;                      // pixels that count, at least one
  std::array<double, 3> mean = {};      // linear light, by channel
  std::array<double, 3> variance = {};  // between its pixels; 0 of a single one

  double LargestMean() const { return std::max({mean[0], mean[1], mean[2]}); }
};

// Calls visit(const LightSquare&) for each square in which a pixel counts, by rows.
template <class Visit>
void ForLightSquares(const Photo& photo, const PlaneU8& mask, const Visit& visit) {
  const LinearTable& linear = LinearTable::Get();
  for (int y0 = 0; y0 < photo.height; y0 += kSquare) {
    for (int x0 = 0; x0 < photo.width; x0 += kSquare) {
      LightSquare square = {.x = x0, .y = y0};
      std::array<double, 3> sum = {}, squares = {};
      for (int y = y0; y < std::min(y0 + kSquare, photo.height); ++y) {
        for (int x = x0; x < std::min(x0 + kSquare, photo.width); ++x) {
          if (!Counts(mask, x, y)) continue;
          ++square.counted;
          for (int c = 0; c < 3; ++c) {
            const double light = linear(photo.pixel(x, y)[c]);
            sum[c] += light;
            squares[c] += light * light;
          }
        }
      }
      if (square.counted == 0) continue;
      const int others = std::max(1, square.counted - 1);
      for (int c = 0; c < 3; ++c) {
        square.mean[c] = sum[c] / square.counted;
        square.variance[c] = std::max(0.0, (squares[c] - sum[c] * square.mean[c]) / others);
      }
      visit(square);
    }
  }
}

}  // namespace litags

#endif  // LITAGS_ENGINE_TARGET_LIGHT_SQUARES_H_
