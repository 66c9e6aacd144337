// ICC profiles of photos, through lcms2.
#include <cstdint>

#include "engine/io/color_space.h"
#include "tests/fuzz/fuzz_support.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace litags;
  constexpr float kCodes[] = {-0.1f, 0, 0.5f, 1, 1.5f, 0.2f, 0.9f, 0};
  for (const int channels : {1, 3, 4}) {
    int16_t samples[6];
    const auto space = ColorSpace::FromIcc(AsText(data, size), channels);
    if (space.has_value()) space->Convert(kCodes, 2, samples);
  }
  return 0;
}
