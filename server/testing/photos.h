#ifndef LITAGS_SERVER_TESTING_PHOTOS_H_
#define LITAGS_SERVER_TESTING_PHOTOS_H_

#include <string>

#include "engine/core/check.h"
#include "engine/core/image.h"
#include "engine/io/picture_io.h"

namespace litags {

// A small dark photo that decodes; `seed` makes its content another one.
inline ImageU8 TestPhoto(int width = 64, int height = 48, int seed = 0) {
  ImageU8 image(width, height);
  for (size_t i = 0; i < image.data.size(); ++i) {
    image.data[i] = static_cast<uint8_t>((i * 7 + static_cast<size_t>(seed) * 31) % 60);
  }
  return image;
}

inline std::string TestPng(int width = 64, int height = 48, int seed = 0) {
  auto bytes = EncodePng(TestPhoto(width, height, seed));
  LITAGS_CHECK(bytes.ok());
  return *std::move(bytes);
}

inline std::string TestJpeg(int width = 64, int height = 48, int seed = 0) {
  auto bytes = EncodeJpeg(TestPhoto(width, height, seed));
  LITAGS_CHECK(bytes.ok());
  return *std::move(bytes);
}

}  // namespace litags

#endif  // LITAGS_SERVER_TESTING_PHOTOS_H_
