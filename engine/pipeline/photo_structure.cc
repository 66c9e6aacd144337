#include "engine/pipeline/photo_structure.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace litags {
namespace {

constexpr int kLeastBlocks = 300;  // 4 standard deviations of noise's correlation are 0.25 then
constexpr int kLeastBlock = 2, kMostBlock = 16;  // px, of the finest level

struct Blocks {
  double at(int c, int r) const { return means[size_t(r) * columns + c]; }

  int columns = 0, rows = 0;
  std::vector<double> means;
};

Blocks BlocksOf(const Photo& photo, int block) {
  Blocks blocks{photo.width / block, photo.height / block, {}};
  for (int r = 0; r < blocks.rows; ++r) {
    for (int c = 0; c < blocks.columns; ++c) {
      double sum = 0;
      for (int y = 0; y < block; ++y) {
        const int16_t* row = photo.pixel(c * block, r * block + y);
        for (int i = 0; i < 3 * block; ++i) sum += row[i];
      }
      blocks.means.push_back(sum);
    }
  }
  return blocks;
}

Blocks Half(const Blocks& fine) {
  Blocks half{fine.columns / 2, fine.rows / 2, {}};
  for (int r = 0; r < half.rows; ++r) {
    for (int c = 0; c < half.columns; ++c) {
      half.means.push_back(fine.at(2 * c, 2 * r) + fine.at(2 * c + 1, 2 * r) +
                           fine.at(2 * c, 2 * r + 1) + fine.at(2 * c + 1, 2 * r + 1));
    }
  }
  return half;
}

// Of blocks `dx` and `dy` apart.
double Correlation(const Blocks& blocks, int dx, int dy) {
  double mean = 0, square = 0, product = 0;
  for (const double m : blocks.means) mean += m / blocks.means.size();
  for (const double m : blocks.means) square += (m - mean) * (m - mean) / blocks.means.size();
  if (!(square > 0)) return 1;
  const int columns = blocks.columns - dx, rows = blocks.rows - dy;
  for (int r = 0; r < rows; ++r) {
    for (int c = 0; c < columns; ++c) {
      product += (blocks.at(c, r) - mean) * (blocks.at(c + dx, r + dy) - mean);
    }
  }
  return product / (double(columns) * rows) / square;
}

}  // namespace

double StructureOf(const Photo& photo) {
  const int side = std::min(photo.width, photo.height);
  int block = kMostBlock;
  while (block > kLeastBlock && 16 * block > side) block /= 2;
  double most = -1;
  for (Blocks blocks = BlocksOf(photo, block); blocks.columns * blocks.rows >= kLeastBlocks;
       blocks = Half(blocks)) {
    most =
        std::max({most, std::abs(Correlation(blocks, 1, 0)), std::abs(Correlation(blocks, 0, 1))});
  }
  return most < 0 ? 1 : std::min(most, 1.0);
}

}  // namespace litags
