// JPEG files for tests that ordinary encoders do not write.
#ifndef LITAGS_ENGINE_IO_TESTING_JPEG_H_
#define LITAGS_ENGINE_IO_TESTING_JPEG_H_

#include <string>

#include "engine/core/image.h"

namespace litags {

enum class TestJpeg {
  kPlain,        // baseline, one scan
  kProgressive,  // the usual ten scans
  kManyScans,    // one coefficient of one component per scan: valid, and slow to decode
  kScanEach,     // sequential, each component in a scan of its own
  kCmyk,
};

std::string EncodeTestJpeg(const ImageU8& image, TestJpeg kind);

struct JpegLayout {
  int across = 1, down = 1;  // pixels to a sample of chroma: 1, 1 is 4:4:4, and 2, 2 is 4:2:0
  bool grey = false;         // of the red channel
  bool progressive = false;
  int quality = 90;
};

std::string EncodeTestJpeg(const ImageU8& image, const JpegLayout& layout);

}  // namespace litags

#endif  // LITAGS_ENGINE_IO_TESTING_JPEG_H_
