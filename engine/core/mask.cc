#include "engine/core/mask.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "engine/core/check.h"
#include "engine/core/error.h"

namespace litags {
namespace {

template <typename T>
struct Level {
  Image<T> image;
  PlaneU8 known;
};

// To the nearest, halves up.
int RoundedRatio(int sum, int count) {
  return static_cast<int>(std::floor(sum / double(count) + 0.5));
}

// Half the size: means of the known pixels of 2x2, known if one of them is. An odd last row or
// column stands for itself.
template <typename T>
Level<T> HalfKnown(const Image<T>& image, const PlaneU8& known) {
  const int width = (image.width + 1) / 2, height = (image.height + 1) / 2;
  Level<T> half{Image<T>(width, height), PlaneU8(width, height)};
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      std::array<int, 3> sum = {0, 0, 0};
      int count = 0;
      for (int sy = 2 * y; sy < std::min(2 * y + 2, image.height); ++sy) {
        for (int sx = 2 * x; sx < std::min(2 * x + 2, image.width); ++sx) {
          if (known.data[size_t(sy) * image.width + sx] == 0) continue;
          for (int c = 0; c < 3; ++c) sum[c] += image.pixel(sx, sy)[c];
          ++count;
        }
      }
      if (count == 0) continue;
      half.known.data[size_t(y) * width + x] = kCounts;
      for (int c = 0; c < 3; ++c) {
        half.image.pixel(x, y)[c] = static_cast<T>(RoundedRatio(sum[c], count));
      }
    }
  }
  return half;
}

// Unknown pixels from the image of half the size, bilinear.
template <typename T>
void FillFrom(const Image<T>& half, const PlaneU8& known, Image<T>* image) {
  for (int y = 0; y < image->height; ++y) {
    const int y0 = y / 2, y1 = std::clamp(y % 2 == 1 ? y0 + 1 : y0 - 1, 0, half.height - 1);
    for (int x = 0; x < image->width; ++x) {
      if (known.data[size_t(y) * image->width + x] != 0) continue;
      const int x0 = x / 2, x1 = std::clamp(x % 2 == 1 ? x0 + 1 : x0 - 1, 0, half.width - 1);
      for (int c = 0; c < 3; ++c) {
        const int sum = 9 * half.pixel(x0, y0)[c] + 3 * half.pixel(x1, y0)[c] +
                        3 * half.pixel(x0, y1)[c] + half.pixel(x1, y1)[c];
        image->pixel(x, y)[c] = static_cast<T>(RoundedRatio(sum, 16));
      }
    }
  }
}

std::string FieldOf(const std::string& mask) { return absl::StrCat("masks[", mask, "]"); }

// Other tools' names: "0001_mask", "0001.jpg.mask".
std::string WithoutMaskWord(const std::string& name) {
  for (const char* word : {"_mask", ".mask"}) {
    if (absl::EndsWithIgnoreCase(name, word)) return name.substr(0, name.size() - 5);
  }
  return name;
}

}  // namespace

const PlaneU8& MaskOf(absl::Span<const PlaneU8> masks, size_t i) {
  static const PlaneU8& none = *new PlaneU8;
  return masks.empty() ? none : masks[i];
}

size_t CountedPixels(const PlaneU8& mask, size_t pixels) {
  return mask.empty() ? pixels
                      : pixels - std::count(mask.data.begin(), mask.data.end(), uint8_t{0});
}

absl::Status CheckMaskSize(const std::string& mask_name, int mask_width, int mask_height,
                           int photo_width, int photo_height) {
  if (mask_width == photo_width && mask_height == photo_height) return absl::OkStatus();
  const std::string field = FieldOf(mask_name);
  return InvalidInput(
      "MASK_SIZE", field,
      absl::StrCat(field, ": the mask is ", mask_width, "x", mask_height, " px, its photo upright ",
                   photo_width, "x", photo_height, "; make masks of the photo's size"));
}

// Pull and push: known colours are averaged down until all is known, and what was unknown is
// interpolated up again.
template <typename T>
void FillMasked(const PlaneU8& mask, Image<T>* image) {
  if (mask.empty()) return;
  LITAGS_CHECK(mask.width == image->width && mask.height == image->height);
  if (std::find(mask.data.begin(), mask.data.end(), uint8_t{0}) == mask.data.end()) return;
  if (mask.data.size() == 1) {
    image->data.assign(3, 0);
    return;
  }
  Level<T> half = HalfKnown(*image, mask);
  FillMasked(half.known, &half.image);
  FillFrom(half.image, mask, image);
}

template void FillMasked(const PlaneU8&, Image<uint8_t>*);
template void FillMasked(const PlaneU8&, Image<int16_t>*);

MaskMatcher::MaskMatcher(absl::Span<const std::string> photos) : photos_(photos) {}

absl::StatusOr<std::string> MaskMatcher::PhotoOf(const std::string& mask) const {
  const std::string wanted = WithoutEnding(mask);
  std::optional<std::string> photo = photos_.Find(wanted);
  if (!photo || photo->empty()) {
    if (auto other = photos_.Find(WithoutMaskWord(wanted))) photo = std::move(other);
  }
  if (photo == "") {
    return InvalidInput("MASK_AMBIGUOUS", FieldOf(mask),
                        absl::StrCat(FieldOf(mask), ": several photos are called ", wanted,
                                     ".*; name the mask <photo's whole name>.png"));
  }
  if (!photo) {
    return InvalidInput(
        "MASK_WITHOUT_PHOTO", FieldOf(mask),
        absl::StrCat(FieldOf(mask), ": there is no photo ", wanted, " or ", wanted,
                     ".*; name masks <photo's name>.png, as 0001.jpg.png, or leave it out"));
  }
  return *std::move(photo);
}

absl::StatusOr<std::map<std::string, std::string>> MatchMasks(absl::Span<const std::string> photos,
                                                              absl::Span<const std::string> masks) {
  const MaskMatcher matcher(photos);
  std::map<std::string, std::string> mask_of;
  for (const std::string& mask : masks) {
    LITAGS_ASSIGN_OR_RETURN(const std::string photo, matcher.PhotoOf(mask));
    const auto [first, added] = mask_of.emplace(photo, mask);
    if (!added) {
      return InvalidInput("MASK_TWICE", FieldOf(mask),
                          absl::StrCat(FieldOf(mask), ": photo ", photo, " has the mask ",
                                       first->second, " already; keep one"));
    }
  }
  return mask_of;
}

}  // namespace litags
