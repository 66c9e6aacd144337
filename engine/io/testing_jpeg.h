// JPEG files for tests that ordinary encoders do not write.
#ifndef LITAGS_ENGINE_IO_TESTING_JPEG_H_
#define LITAGS_ENGINE_IO_TESTING_JPEG_H_

#include <string>

#include "engine/core/image.h"

namespace litags {

enum class TestJpeg {
  kProgressive,  // the usual ten scans
  kManyScans,    // one coefficient of one component per scan: valid, and slow to decode
  kCmyk,
};

std::string EncodeTestJpeg(const ImageU8& image, TestJpeg kind);

}  // namespace litags

#endif  // LITAGS_ENGINE_IO_TESTING_JPEG_H_
