// HEVC pictures of HEIC files, by libde265.
#include <libde265/de265.h>

#include <optional>
#include <string>
#include <string_view>

#include "engine/io/byte_reader.h"
#include "engine/io/heif_codecs.h"

namespace litags {
namespace {

// Bits of a NAL unit's payload, most significant first; zeros behind the end.
class BitReader {
 public:
  explicit BitReader(std::string bytes) : bytes_(std::move(bytes)) {}

  uint32_t Bits(int n) {
    uint32_t value = 0;
    for (; n > 0; --n, ++at_) value = value << 1 | Bit();
    return value;
  }
  void Skip(size_t n) { at_ += n; }
  bool AtEnd() const { return at_ >= 8 * bytes_.size(); }

  // ue(v), Exp-Golomb.
  uint32_t Number() {
    int zeros = 0;
    while (zeros < 31 && !AtEnd() && Bits(1) == 0) ++zeros;
    return (uint32_t{1} << zeros) - 1 + Bits(zeros);
  }

 private:
  uint32_t Bit() const {
    return AtEnd() ? 0 : static_cast<uint8_t>(bytes_[at_ / 8]) >> (7 - at_ % 8) & 1u;
  }

  const std::string bytes_;
  size_t at_ = 0;
};

// Without the bytes that keep start codes out of it.
std::string PayloadOf(std::string_view nal) {
  std::string out;
  int zeros = 0;
  for (const char byte : nal) {
    if (zeros >= 2 && byte == 3) {
      zeros = 0;
      continue;
    }
    zeros = byte == 0 ? zeros + 1 : 0;
    out += byte;
  }
  return out;
}

heif_error NewDecoder(void** decoder) {
  *decoder = de265_new_decoder();  // which starts no threads unless told to
  return *decoder != nullptr ? kHeifOk : CodecError("there is no memory to decode it");
}

void FreeDecoder(void* decoder) { de265_free_decoder(decoder); }

// NAL units, each behind its length.
heif_error PushData(void* decoder, const void* data, size_t size) {
  constexpr int kSequenceParameters = 33;
  ByteReader reader({static_cast<const char*>(data), size});
  while (reader.remaining() > 0) {
    uint32_t length = 0;
    std::string_view nal;
    if (!reader.ReadBig(&length) || !reader.ReadBytes(length, &nal)) {
      return {heif_error_Decoder_plugin_error, heif_suberror_End_of_data, "its picture ends early"};
    }
    if (nal.empty()) continue;
    if ((nal[0] >> 1 & 0x3F) == kSequenceParameters) {
      const CodedSize coded = HevcSizeOf(nal);
      if (!IsCodedSizeTaken(coded.width, coded.height)) return CodecSizeError();
    }
    if (!de265_isOK(de265_push_NAL(decoder, nal.data(), static_cast<int>(length), 0, nullptr))) {
      return CodecError("its picture cannot be read");
    }
  }
  return kHeifOk;
}

std::optional<heif_chroma> ChromaOf(const de265_image* image) {
  switch (de265_get_chroma_format(image)) {
    case de265_chroma_mono:
      return heif_chroma_monochrome;
    case de265_chroma_420:
      return heif_chroma_420;
    case de265_chroma_422:
      return heif_chroma_422;
    case de265_chroma_444:
      return heif_chroma_444;
  }
  return std::nullopt;
}

heif_error Copy(const de265_image* image, heif_image** out) {
  CodedPicture picture;
  const std::optional<heif_chroma> chroma = ChromaOf(image);
  if (!chroma.has_value()) return CodecError("its picture has no known layout");
  picture.chroma = *chroma;
  picture.width = de265_get_image_width(image, 0);
  picture.height = de265_get_image_height(image, 0);
  picture.bits = de265_get_bits_per_pixel(image, 0);
  const int n = *chroma == heif_chroma_monochrome ? 1 : 3;
  for (int c = 0; c < n; ++c) {
    int stride = 0;
    picture.planes[c] = de265_get_image_plane(image, c, &stride);
    picture.strides[c] = stride;
    if (de265_get_bits_per_pixel(image, c) != picture.bits) {
      return CodecError("its chroma has other bits than its luma");
    }
  }
  picture.kind = {.matrix = de265_get_image_matrix_coefficients(image),
                  .primaries = de265_get_image_colour_primaries(image),
                  .transfer = de265_get_image_transfer_characteristics(image),
                  .full_range = de265_get_image_full_range_flag(image) != 0,
                  .bits = picture.bits};
  return CopyPicture(picture, out);
}

// The first picture. What libde265 only warns of, as a slice that ends early, is an error, too.
heif_error DecodeImage(void* decoder, heif_image** out) {
  de265_flush_data(decoder);
  for (int more = 1; more != 0;) {
    const de265_error error = de265_decode(decoder, &more);
    if (!de265_isOK(error) && error != DE265_ERROR_WAITING_FOR_INPUT_DATA) {
      return CodecError(de265_get_error_text(error));
    }
    const de265_image* image = de265_get_next_picture(decoder);
    const de265_error warning = de265_get_warning(decoder);
    if (warning != DE265_OK) return CodecError(de265_get_error_text(warning));
    if (image != nullptr) return Copy(image, out);
    if (error == DE265_ERROR_WAITING_FOR_INPUT_DATA) break;
  }
  return CodecError("it has no picture");
}

}  // namespace

// ITU-T H.265, 7.3.2.2.
CodedSize HevcSizeOf(std::string_view nal) {
  constexpr size_t kHeadBits = 16, kProfileBits = 88, kLevelBits = 8;
  constexpr size_t kEnough = 512;  // bytes of it, more than come before the size
  BitReader bits(PayloadOf(nal.substr(0, kEnough)));
  bits.Skip(kHeadBits + 4);
  const int layers = static_cast<int>(bits.Bits(3));  // less one
  bits.Skip(1 + kProfileBits + kLevelBits);
  size_t more = 0;
  for (int i = 0; i < layers; ++i) {
    if (bits.Bits(1) == 1) more += kProfileBits;
    if (bits.Bits(1) == 1) more += kLevelBits;
  }
  if (layers > 0) bits.Skip(2 * (8 - layers));
  bits.Skip(more);
  bits.Number();  // its identifier
  constexpr uint32_t kFullChroma = 3;
  if (bits.Number() == kFullChroma) bits.Skip(1);
  CodedSize size;
  size.width = bits.Number();
  size.height = bits.Number();
  return size;
}

const heif_decoder_plugin kHevcCodec = {
    .plugin_api_version = 3,
    .get_plugin_name = [] { return "libde265 in one thread"; },
    .init_plugin = [] { de265_init(); },
    .deinit_plugin = [] { de265_free(); },
    .does_support_format =
        [](heif_compression_format format) {
          return format == heif_compression_HEVC ? kCodecPriority : 0;
        },
    .new_decoder = NewDecoder,
    .free_decoder = FreeDecoder,
    .push_data = PushData,
    .decode_image = DecodeImage,
    .set_strict_decoding = [](void*, int) {},
    .id_name = "litags-hevc"};

}  // namespace litags
