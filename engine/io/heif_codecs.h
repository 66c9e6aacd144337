// Inside this module: how HEIC's and AVIF's pictures are decoded. libheif's own wrappers of the
// same libraries start threads, which a process that may only compute cannot, and decode pictures
// of any size.
#ifndef LITAGS_ENGINE_IO_HEIF_CODECS_H_
#define LITAGS_ENGINE_IO_HEIF_CODECS_H_

#include <libheif/heif.h>
#include <libheif/heif_plugin.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

namespace litags {

// Has libheif load what it needs and decode by the two codecs below, from the first call on.
// Thread-safe.
void UseHeifCodecs();

// In the calling thread; pictures within kMaxImagePixels and kMaxImageSide by their stream's
// header.
extern const heif_decoder_plugin kHevcCodec;  // hevc_codec.cc, by libde265
extern const heif_decoder_plugin kAv1Codec;   // av1_codec.cc, by dav1d

// Priority of a codec for its format, above libheif's own.
inline constexpr int kCodecPriority = 1000;

inline constexpr heif_error kHeifOk = {heif_error_Ok, heif_suberror_Unspecified, "Success"};

// `message` must outlive the program.
heif_error CodecError(const char* message);
heif_error CodecSizeError();  // the stream states a larger picture than is taken

// What a codec decoded: the codec's memory.
struct CodedPicture {
  int width = 0, height = 0, bits = 8;
  heif_chroma chroma = heif_chroma_420;
  std::array<const uint8_t*, 3> planes = {};
  std::array<ptrdiff_t, 3> strides = {};  // bytes
  // Code points, by which YCbCr becomes RGB if the file has none.
  uint16_t primaries = 2, transfer = 2, matrix = 2;
  bool full_range = false;
};
heif_error CopyPicture(const CodedPicture& picture, heif_image** out);

// Pixels that this thread has copied since it was last asked. libheif leaves what a grid's tiles do
// not cover as memory had it.
uint64_t TakeCodedPixels();

struct CodedSize {
  uint32_t width = 0, height = 0;
};
// What a sequence parameter set, a NAL unit of HEVC, says that a decoder is to allocate.
CodedSize HevcSizeOf(std::string_view nal);

// Whether the pixels of a picture may be allocated.
bool IsCodedSizeTaken(uint64_t width, uint64_t height);

}  // namespace litags

#endif  // LITAGS_ENGINE_IO_HEIF_CODECS_H_
