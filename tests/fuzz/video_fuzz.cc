// Videos: containers, codecs, colours, rotation; every frame within limits.
#include "engine/core/check.h"
#include "engine/video/video_file.h"
#include "tests/fuzz/fuzz_support.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace litags;
  VideoLimits limits;
  limits.max_frames = 8;
  limits.max_pixels = 1 << 18;
  const auto video = VideoFile::Open(AsText(data, size), "videos[x]", limits);
  if (!video.ok()) return 0;
  const VideoInfo& info = (*video)->info();
  LITAGS_CHECK(info.width > 0 && info.width <= limits.max_side);
  LITAGS_CHECK(info.height > 0 && info.height <= limits.max_side);
  for (;;) {
    const auto more = (*video)->Next();
    if (!more.ok() || !*more) return 0;
    const Planes luma = (*video)->Luma(64);
    LITAGS_CHECK(luma.width <= 64 && luma.height <= 64);
    const Photo photo = (*video)->Picture();
    LITAGS_CHECK(photo.width == info.width && photo.height == info.height);
  }
}
