// Made-up photos for tests of which photos are compared.
#ifndef LITAGS_ENGINE_SFM_WALK_TEST_UTIL_H_
#define LITAGS_ENGINE_SFM_WALK_TEST_UTIL_H_

#include <cstdint>
#include <vector>

#include "engine/sfm/descriptor_match.h"

namespace litags {

// Descriptors [count, 128] of features first .. first + count - 1 of 1024: each matches only
// itself, for of four large entries any two share at most two.
inline std::vector<uint8_t> PhotoOfFeatures(int first, int count) {
  std::vector<uint8_t> descriptors(static_cast<size_t>(count) * kDescriptorSize, 0);
  for (int i = 0; i < count; ++i) {
    const int low = (first + i) % 32, high = (first + i) / 32 % 32;
    for (const int entry : {low, 32 + high, 64 + (low + high) % 32, 96 + (low + 2 * high) % 32}) {
      descriptors[static_cast<size_t>(i) * kDescriptorSize + static_cast<size_t>(entry)] = 255;
    }
  }
  return descriptors;
}

// Photos of a straight walk: each sees 40 features and shares 30, 20, 10 with the next ones.
inline std::vector<std::vector<uint8_t>> PhotosOfAWalk(int num_photos) {
  std::vector<std::vector<uint8_t>> photos;
  for (int i = 0; i < num_photos; ++i) photos.push_back(PhotoOfFeatures(10 * i, 40));
  return photos;
}

}  // namespace litags

#endif  // LITAGS_ENGINE_SFM_WALK_TEST_UTIL_H_
