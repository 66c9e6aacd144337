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

#include "engine/io/ycbcr.h"

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
  ChromaSite site_x = ChromaSite::kCentre, site_y = ChromaSite::kCentre;
  std::array<const uint8_t*, 3> planes = {};
  std::array<ptrdiff_t, 3> strides = {};  // bytes
  YCbCrKind kind;                         // as the stream says
};

// Hands a picture to libheif as RGB: Y as red, Cb as green, Cr as blue, chroma interpolated to full
// size. libheif then only puts tiles together, turns and crops. Told the truth, it would make RGB
// itself, repeat chroma instead of interpolating it, and cut off what lies below black. Fractions
// of a code of chroma are kept: of 8-bit pictures in the alpha channel, of others in 16-bit
// samples.
heif_error CopyPicture(const CodedPicture& picture, heif_image** out);

// Rows of a picture that libheif made of what CopyPicture gave it.
class CodedRows {
 public:
  // False: it is made of something else, as a picture of several laid over each other is, or has
  // another size.
  bool Open(const heif_image* image, int width, int height);
  int bits() const { return bits_; }
  // Y, Cb and Cr in codes.
  void Row(int y, float* luma, float* cb, float* cr) const;

 private:
  int width_ = 0, bits_ = 0;
  std::array<const uint8_t*, 4> planes_ = {};
  std::array<ptrdiff_t, 4> strides_ = {};  // bytes
};

// What this thread has copied since it was last asked.
struct CodedPictures {
  uint64_t pixels = 0;  // of all. libheif leaves what a grid's tiles do not cover as memory had it
  YCbCrKind kind;       // of the last
  bool grey = false;    // the last
};
CodedPictures TakeCodedPictures();

struct CodedSize {
  uint32_t width = 0, height = 0;
};
// What a sequence parameter set, a NAL unit of HEVC, says that a decoder is to allocate.
CodedSize HevcSizeOf(std::string_view nal);

// Whether the pixels of a picture may be allocated.
bool IsCodedSizeTaken(uint64_t width, uint64_t height);

}  // namespace litags

#endif  // LITAGS_ENGINE_IO_HEIF_CODECS_H_
