// Masks of photos: which pixels show the scene, and which a moving person, the robot's own arm, a
// time stamp, dirt on the lens.
#ifndef LITAGS_ENGINE_CORE_MASK_H_
#define LITAGS_ENGINE_CORE_MASK_H_

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <map>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "engine/core/color.h"
#include "engine/core/image.h"
#include "engine/core/photo_names.h"

namespace litags {

// A mask is a PlaneU8 of its photo's size with kCounts or 0 (does not count) for each pixel; an
// empty one stands for a photo all of whose pixels count.
inline constexpr uint8_t kCounts = 255;

// The mask of photo i. `masks` may be empty: no photo has one.
const PlaneU8& MaskOf(absl::Span<const PlaneU8> masks, size_t i);

// Pixels that count, of an image of `pixels`.
size_t CountedPixels(const PlaneU8& mask, size_t pixels);

inline bool Counts(const PlaneU8& mask, int x, int y) {
  return mask.empty() || mask.data[size_t(y) * mask.width + x] != 0;
}

// True if the pixel and its four neighbours count.
inline bool NeighboursCount(const PlaneU8& mask, int x, int y) {
  return mask.empty() || (Counts(mask, x, y) && Counts(mask, x - 1, y) && Counts(mask, x + 1, y) &&
                          Counts(mask, x, y - 1) && Counts(mask, x, y + 1));
}

// body(i) for every pixel that counts, of an image of `pixels`.
template <class Body>
void ForCounted(const PlaneU8& mask, size_t pixels, Body body) {
  for (size_t i = 0; i < pixels; ++i) {
    if (mask.empty() || mask.data[i] != 0) body(i);
  }
}

// body(i) for every pixel that does not count.
template <class Body>
void ForMasked(const PlaneU8& mask, Body body) {
  const uint8_t *begin = mask.data.data(), *end = begin + mask.data.size(), *p = begin;
  // Masks are blobs: what counts is skipped at the speed of memory.
  while (p != end && (p = static_cast<const uint8_t*>(std::memchr(p, 0, end - p))) != nullptr) {
    for (; p != end && *p == 0; ++p) body(static_cast<size_t>(p - begin));
  }
}

// Gives the pixels that do not count colours from around them, smooth and without an edge, so that
// filters which read neighbours meet nothing of what was there. Sizes agree (LITAGS_CHECK). A mask
// without any pixel that counts makes the image black.
// ImageU8 or Photo.
template <typename T>
void FillMasked(const PlaneU8& mask, Image<T>* image);

// INVALID_ARGUMENT (MASK_SIZE) with field "masks[NAME]" unless both have the same size, in pixels,
// the photo's taken upright.
absl::Status CheckMaskSize(const std::string& mask_name, int mask_width, int mask_height,
                           int photo_width, int photo_height);

// Which photo a mask belongs to, by file names: <photo's name>.png, as COLMAP has it, else
// <photo's stem>.png if one photo only has that stem.
class MaskMatcher {
 public:
  explicit MaskMatcher(absl::Span<const std::string> photos);

  // INVALID_ARGUMENT with field "masks[NAME]": MASK_WITHOUT_PHOTO, MASK_AMBIGUOUS.
  absl::StatusOr<std::string> PhotoOf(const std::string& mask) const;

 private:
  PhotoNames photos_;
};

// Which mask belongs to which photo. Errors of MaskMatcher, and INVALID_ARGUMENT (MASK_TWICE).
absl::StatusOr<std::map<std::string, std::string>> MatchMasks(absl::Span<const std::string> photos,
                                                              absl::Span<const std::string> masks);

}  // namespace litags

#endif  // LITAGS_ENGINE_CORE_MASK_H_
