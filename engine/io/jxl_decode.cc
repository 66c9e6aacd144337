// JPEG XL, by libjxl: the first frame, with the precision that it has.
#include <jxl/decode.h>

#include <memory>
#include <string>
#include <vector>

#include "engine/io/byte_reader.h"
#include "engine/io/color_space.h"
#include "engine/io/image_header.h"
#include "engine/io/io_error.h"
#include "engine/io/photo_format.h"

namespace litags {
namespace {

constexpr std::string_view kStream = "\xFF\x0A";
constexpr std::string_view kContainer("\0\0\0\x0CJXL \r\n\x87\n", 12);
constexpr uint32_t kMaxExtraChannels = 4;
constexpr JxlColorProfileTarget kPixels = JXL_COLOR_PROFILE_TARGET_DATA;

struct Destroyer {
  void operator()(JxlDecoder* decoder) const { JxlDecoderDestroy(decoder); }
};
using Decoder = std::unique_ptr<JxlDecoder, Destroyer>;

bool IsJxl(std::string_view bytes) {
  return bytes.starts_with(kStream) || bytes.starts_with(kContainer);
}

// Turns the picture upright by itself, in the calling thread.
Decoder Open(std::string_view bytes, int events) {
  Decoder decoder(JxlDecoderCreate(nullptr));
  JxlDecoderSubscribeEvents(decoder.get(), events);
  JxlDecoderSetInput(decoder.get(), reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size());
  return decoder;
}

absl::Status ErrorOf(JxlDecoderStatus status, std::string_view field) {
  if (status == JXL_DEC_NEED_MORE_INPUT) {
    return InvalidField("IMAGE_TRUNCATED", field,
                        "the JPEG XL file ends early; send the whole file again");
  }
  return InvalidField("IMAGE_CORRUPT", field,
                      "the JPEG XL file cannot be decoded; send the file again");
}

// The TIFF block of a container; empty without one.
std::string_view ExifOf(std::string_view bytes) {
  if (!bytes.starts_with(kContainer)) return "";
  ByteReader reader(bytes);
  uint32_t size = 0, offset = 0;
  std::string_view type, data;
  while (reader.ReadBig(&size) && reader.ReadBytes(4, &type) && size >= 8 &&
         reader.ReadBytes(size - 8, &data)) {
    if (type != "Exif") continue;
    ByteReader block(data);
    return block.ReadBig(&offset) && block.Skip(offset) ? data.substr(block.position()) : "";
  }
  return "";
}

absl::StatusOr<ImageInfo> ReadJxlInfo(std::string_view bytes, std::string_view field) {
  const Decoder decoder = Open(bytes, JXL_DEC_BASIC_INFO);
  const JxlDecoderStatus status = JxlDecoderProcessInput(decoder.get());
  JxlBasicInfo basic;
  if (status != JXL_DEC_BASIC_INFO ||
      JxlDecoderGetBasicInfo(decoder.get(), &basic) != JXL_DEC_SUCCESS) {
    return ErrorOf(status, field);
  }
  if (basic.xsize == 0 || basic.ysize == 0 || basic.xsize > INT32_MAX || basic.ysize > INT32_MAX) {
    return InvalidField("IMAGE_CORRUPT", field, "the JPEG XL file states an impossible size");
  }
  // Each has the pixels of a picture.
  if (basic.num_extra_channels > kMaxExtraChannels) {
    return InvalidField("IMAGE_UNSUPPORTED", field,
                        absl::StrCat("a JPEG XL file with ", basic.num_extra_channels,
                                     " channels beside its colours; save it without them"));
  }
  ImageInfo info;
  info.format = ImageFormat::kJxl;
  ReadExif(ExifOf(bytes), &info);
  info.orientation = 1;
  info.width = static_cast<int>(basic.xsize);
  info.height = static_cast<int>(basic.ysize);
  info.bit_depth = static_cast<int>(basic.bits_per_sample);
  return info;
}

std::string ProfileOf(JxlDecoder* decoder) {
  size_t size = 0;
  if (JxlDecoderGetICCProfileSize(decoder, nullptr, kPixels, &size) != JXL_DEC_SUCCESS ||
      size > kMaxProfileBytes) {
    return "";
  }
  std::string icc(size, '\0');
  JxlDecoderGetColorAsICCProfile(decoder, nullptr, kPixels, reinterpret_cast<uint8_t*>(icc.data()),
                                 size);
  return icc;
}

// By the file's profile, for `channels`. PQ and HLG by their code points, for RGB: libjxl's profile
// of them has the light of a screen.
absl::StatusOr<ColorSpace> ColorsOf(JxlDecoder* decoder, int channels, std::string_view field) {
  JxlColorEncoding colors = {};  // libjxl leaves the primaries of grey as they are
  if (JxlDecoderGetColorAsEncodedProfile(decoder, nullptr, kPixels, &colors) != JXL_DEC_SUCCESS ||
      (colors.transfer_function != JXL_TRANSFER_FUNCTION_PQ &&
       colors.transfer_function != JXL_TRANSFER_FUNCTION_HLG)) {
    return ColorSpace::FromIccOrSrgb(ProfileOf(decoder), channels);
  }
  constexpr int kP3 = 12;  // with the white of D65, in ITU-T H.273
  const int primaries = colors.primaries == JXL_PRIMARIES_P3 ? kP3 : colors.primaries;
  return ColorSpace::FromCodePoints(primaries, colors.transfer_function, field);
}

absl::StatusOr<Photo> DecodeJxl(std::string_view bytes, const ImageInfo& info,
                                std::string_view field) {
  const Decoder decoder =
      Open(bytes, JXL_DEC_BASIC_INFO | JXL_DEC_COLOR_ENCODING | JXL_DEC_FULL_IMAGE);
  JxlPixelFormat format = {3, JXL_TYPE_FLOAT, JXL_NATIVE_ENDIAN, 0};
  std::vector<float> codes;
  ColorSpace space = ColorSpace::Srgb(3);
  while (true) {
    const JxlDecoderStatus status = JxlDecoderProcessInput(decoder.get());
    if (status == JXL_DEC_FULL_IMAGE) break;
    if (status == JXL_DEC_BASIC_INFO) {
      JxlBasicInfo basic;
      JxlDecoderGetBasicInfo(decoder.get(), &basic);
      format.num_channels = basic.num_color_channels == 1 ? 1 : 3;
      space = ColorSpace::Srgb(static_cast<int>(format.num_channels));
    } else if (status == JXL_DEC_COLOR_ENCODING) {
      LITAGS_ASSIGN_OR_RETURN(space, ColorsOf(decoder.get(), space.channels(), field));
      format.num_channels = space.channels();
    } else if (status == JXL_DEC_NEED_IMAGE_OUT_BUFFER) {
      size_t size = 0;
      codes.resize(size_t{format.num_channels} * info.width * info.height);
      if (JxlDecoderImageOutBufferSize(decoder.get(), &format, &size) != JXL_DEC_SUCCESS ||
          size != codes.size() * sizeof(float) ||
          JxlDecoderSetImageOutBuffer(decoder.get(), &format, codes.data(), size) !=
              JXL_DEC_SUCCESS) {
        return ErrorOf(JXL_DEC_ERROR, field);
      }
    } else {
      return ErrorOf(status, field);
    }
  }
  Photo photo(info.width, info.height);
  space.Convert(codes.data(), photo.pixels(), photo.data.data());
  return photo;
}

}  // namespace

const PhotoFormat kJxlFormat = {ImageFormat::kJxl, "JPEG XL", IsJxl, ReadJxlInfo, DecodeJxl};

}  // namespace litags
