// Helpers of this module's tests.
#ifndef LITAGS_ENGINE_IO_TEST_UTIL_H_
#define LITAGS_ENGINE_IO_TEST_UTIL_H_

#include <gtest/gtest.h>

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>

#include "engine/core/image.h"
#include "engine/core/rng.h"
#include "engine/io/file_util.h"

namespace litags {

// The photo sets kept beside the source tree (or above it); empty where there are none.
inline std::string SharedScenes() {
  namespace fs = std::filesystem;
  for (fs::path dir = LITAGS_SOURCE_DIR; dir.has_relative_path(); dir = dir.parent_path()) {
    const fs::path scenes = dir.parent_path() / "shared" / "scenes";
    if (fs::is_directory(scenes)) return scenes.string();
  }
  return "";
}

// Of a file that must be there.
inline std::string Bytes(const std::string& path) {
  const auto bytes = ReadFile(path, "", int64_t{1} << 28);
  EXPECT_TRUE(bytes.ok()) << bytes.status();
  return bytes.value_or("");
}

// Calls `check` with `bytes` after each of `count` changes of one to four bytes, all seeded.
inline void ForEachCorruption(const std::string& bytes, int count,
                              const std::function<void(const std::string&)>& check) {
  const CounterRng rng(7, 0);
  uint64_t counter = 0;
  for (int i = 0; i < count; ++i) {
    std::string broken = bytes;
    const uint64_t changes = 1 + rng.Below(counter++, 4);
    for (uint64_t k = 0; k < changes; ++k) {
      const uint64_t where = rng.Below(counter++, broken.size());
      broken[where] = static_cast<char>(rng.Below(counter++, 256));
    }
    check(broken);
  }
}

// Smooth colours with some texture, so that JPEG has something to do.
inline ImageU8 TestImage(int width, int height) {
  ImageU8 image(width, height);
  const CounterRng rng(1, 0);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      uint8_t* p = image.pixel(x, y);
      p[0] = static_cast<uint8_t>(255 * x / width);
      p[1] = static_cast<uint8_t>(255 * y / height);
      p[2] = static_cast<uint8_t>(100 + rng.Below(uint64_t(y) * width + x, 50));
    }
  }
  return image;
}

}  // namespace litags

#endif  // LITAGS_ENGINE_IO_TEST_UTIL_H_
