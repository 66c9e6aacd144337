// HEIC and AVIF, by libheif: the primary picture, of 8 to 16 bits.
#include <libheif/heif.h>

#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include "engine/core/camera.h"
#include "engine/io/byte_reader.h"
#include "engine/io/color_space.h"
#include "engine/io/heif_codecs.h"
#include "engine/io/heif_references.h"
#include "engine/io/image_header.h"
#include "engine/io/io_error.h"
#include "engine/io/photo_format.h"
#include "engine/io/ycbcr.h"

namespace litags {
namespace {

constexpr size_t kMaxExifBytes = size_t{1} << 20;

// libheif counts bytes of a picture in 32 bits.
constexpr int kMaxDecodedSide = 18'900;

constexpr int kBt601 = 6;  // a matrix of ITU-T H.273

template <auto kFree>
struct Freer {
  template <class T>
  void operator()(T* object) const {
    kFree(object);
  }
};
using Context = std::unique_ptr<heif_context, Freer<heif_context_free>>;
using Handle = std::unique_ptr<heif_image_handle, Freer<heif_image_handle_release>>;
using Picture = std::unique_ptr<heif_image, Freer<heif_image_release>>;
using Options = std::unique_ptr<heif_decoding_options, Freer<heif_decoding_options_free>>;
using CodePoints = std::unique_ptr<heif_color_profile_nclx, Freer<heif_nclx_color_profile_free>>;

bool IsHeif(std::string_view bytes) {
  constexpr std::string_view kBrands[] = {"heic", "heix", "heim", "heis", "hevc", "hevx",
                                          "mif1", "msf1", "avif", "avis", "mif2"};
  ByteReader reader(bytes);
  uint32_t size = 0;
  std::string_view type, brand;
  return reader.ReadBig(&size) && reader.ReadBytes(4, &type) && type == "ftyp" &&
         reader.ReadBytes(4, &brand) &&
         std::find(std::begin(kBrands), std::end(kBrands), brand) != std::end(kBrands);
}

absl::Status ErrorOf(const heif_error& error, std::string_view field) {
  if (error.subcode == heif_suberror_End_of_data) {
    return InvalidField("IMAGE_TRUNCATED", field,
                        "the HEIC or AVIF file ends early; send the whole file again");
  }
  if (error.subcode == heif_suberror_Security_limit_exceeded) {
    return InvalidField("IMAGE_TOO_LARGE", field,
                        absl::StrCat("the HEIC or AVIF file asks for too much memory (",
                                     error.message, "); save it anew, or smaller"));
  }
  const bool unsupported = error.code == heif_error_Unsupported_feature ||
                           error.code == heif_error_Unsupported_filetype ||
                           error.code == heif_error_Plugin_loading_error;
  return InvalidField(unsupported ? "IMAGE_UNSUPPORTED" : "IMAGE_CORRUPT", field,
                      absl::StrCat("the HEIC or AVIF file cannot be decoded (", error.message,
                                   unsupported ? "); " : "); send the file again, or ",
                                   "convert it to JPEG or PNG"));
}

// A file's primary picture, not decoded.
struct HeifFile {
  std::string alone;  // the file, which `context` reads, unless it is empty
  Context context;
  Handle handle;

  absl::Status Open(std::string_view bytes, std::string_view field) {
    if (!HeifReferencesEnd(bytes)) {
      return InvalidField("IMAGE_CORRUPT", field,
                          "the HEIC or AVIF file's picture is made of itself; send it again");
    }
    UseHeifCodecs();
    alone = WithoutOtherPictures(bytes);
    if (!alone.empty()) bytes = alone;
    context.reset(heif_context_alloc());
    heif_context_set_max_decoding_threads(context.get(), 0);
    heif_context_set_maximum_image_size_limit(context.get(), kMaxImageSide + 1);
    heif_error error = heif_context_read_from_memory_without_copy(context.get(), bytes.data(),
                                                                  bytes.size(), nullptr);
    if (error.code != heif_error_Ok) return ErrorOf(error, field);
    heif_image_handle* primary = nullptr;
    error = heif_context_get_primary_image_handle(context.get(), &primary);
    if (error.code != heif_error_Ok) return ErrorOf(error, field);
    handle.reset(primary);
    return LimitGrid(field);
  }

  // A grid of tiles states its size twice. libheif allocates by the one that it does not tell us,
  // so that this is held to the sides of the other.
  absl::Status LimitGrid(std::string_view field) {
    const int side = std::max(heif_image_handle_get_ispe_width(handle.get()),
                              heif_image_handle_get_ispe_height(handle.get()));
    if (side > kMaxDecodedSide) {
      return InvalidField("IMAGE_TOO_LARGE", field,
                          absl::StrCat(side, " px on a side exceed ", kMaxDecodedSide,
                                       " px, which a HEIC or AVIF file may have; resize it"));
    }
    heif_context_set_maximum_image_size_limit(context.get(), side + 1);
    return absl::OkStatus();
  }

  // The TIFF block; empty without one.
  std::string Exif() const {
    heif_item_id id = 0;
    if (heif_image_handle_get_list_of_metadata_block_IDs(handle.get(), "Exif", &id, 1) != 1) {
      return "";
    }
    const size_t size = heif_image_handle_get_metadata_size(handle.get(), id);
    if (size < 4 || size > kMaxExifBytes) return "";
    std::string block(size, '\0');
    if (heif_image_handle_get_metadata(handle.get(), id, block.data()).code != heif_error_Ok) {
      return "";
    }
    uint32_t offset = 0;
    ByteReader reader(block);
    return reader.ReadBig(&offset) && reader.Skip(offset) ? block.substr(4 + size_t{offset}) : "";
  }

  // The code points of the file; nullptr without any.
  CodePoints Points() const {
    heif_color_profile_nclx* points = nullptr;
    heif_image_handle_get_nclx_color_profile(handle.get(), &points);
    return CodePoints(points);
  }

  // As the file says, else as the stream does.
  absl::StatusOr<ColorSpace> Colors(const YCbCrKind& stream, std::string_view field) const {
    const size_t size = heif_image_handle_get_raw_color_profile_size(handle.get());
    if (size > 0 && size <= kMaxProfileBytes) {
      std::string icc(size, '\0');
      heif_image_handle_get_raw_color_profile(handle.get(), icc.data());
      return ColorSpace::FromIccOrSrgb(icc, 3);
    }
    const CodePoints points = Points();
    if (points == nullptr) {
      return ColorSpace::FromCodePoints(stream.primaries, stream.transfer, field);
    }
    return ColorSpace::FromCodePoints(points->color_primaries, points->transfer_characteristics,
                                      field);
  }

  // How what was coded becomes RGB: as the file says, else as the stream does.
  YCbCrToRgb Conversion(const CodedPictures& coded, int bits) const {
    YCbCrKind kind = coded.kind;
    if (const CodePoints points = Points(); points != nullptr) {
      kind.matrix = points->matrix_coefficients;
      kind.primaries = points->color_primaries;
      kind.full_range = points->full_range_flag != 0;
    }
    kind.bits = bits;
    if (coded.grey) kind.matrix = kBt601;  // any that makes R = G = B of it
    return YCbCrToRgb(kind);
  }
};

absl::StatusOr<ImageInfo> ReadHeifInfo(std::string_view bytes, std::string_view field) {
  HeifFile file;
  LITAGS_RETURN_IF_ERROR(file.Open(bytes, field));
  ImageInfo info;
  info.format = ImageFormat::kHeif;
  info.width = heif_image_handle_get_width(file.handle.get());
  info.height = heif_image_handle_get_height(file.handle.get());
  info.bit_depth = heif_image_handle_get_luma_bits_per_pixel(file.handle.get());
  if (info.width <= 0 || info.height <= 0) {
    return InvalidField("IMAGE_CORRUPT", field, "the HEIC or AVIF file states no picture size");
  }
  ReadExif(file.Exif(), &info);
  info.orientation = 1;  // libheif turns the picture, as the file's own properties say
  return info;
}

absl::StatusOr<Photo> DecodeHeif(std::string_view bytes, const ImageInfo& info,
                                 std::string_view field) {
  HeifFile file;
  LITAGS_RETURN_IF_ERROR(file.Open(bytes, field));
  const Options options(heif_decoding_options_alloc());
  options->strict_decoding = 1;
  TakeCodedPictures();
  heif_image* decoded = nullptr;
  const heif_error error = heif_decode_image(file.handle.get(), &decoded, heif_colorspace_RGB,
                                             heif_chroma_444, options.get());
  const Picture picture(decoded);
  if (error.code != heif_error_Ok) return ErrorOf(error, field);
  const CodedPictures coded = TakeCodedPictures();
  LITAGS_ASSIGN_OR_RETURN(const ColorSpace space, file.Colors(coded.kind, field));
  const auto stored = static_cast<uint64_t>(heif_image_handle_get_ispe_width(file.handle.get())) *
                      static_cast<uint64_t>(heif_image_handle_get_ispe_height(file.handle.get()));
  if (coded.pixels < stored) {
    return InvalidField("IMAGE_CORRUPT", field,
                        "the HEIC or AVIF file's tiles do not cover its picture; send it again");
  }
  if (heif_image_get_width(decoded, heif_channel_R) != info.width ||
      heif_image_get_height(decoded, heif_channel_R) != info.height) {
    return InvalidField("IMAGE_CORRUPT", field,
                        "the HEIC or AVIF file's picture is not of the size that it states");
  }
  CodedRows rows;
  if (!rows.Open(decoded, info.width, info.height)) {
    return InvalidField("IMAGE_UNSUPPORTED", field,
                        "a HEIC or AVIF file of pictures laid over each other; save it as one");
  }
  const YCbCrToRgb conversion = file.Conversion(coded, rows.bits());
  const size_t width = info.width;
  Photo photo(info.width, info.height);
  std::vector<float> luma(width), cb(width), cr(width), rgb(3 * width);
  for (int y = 0; y < info.height; ++y) {
    rows.Row(y, luma.data(), cb.data(), cr.data());
    conversion.Convert(luma.data(), cb.data(), cr.data(), width, rgb.data());
    space.Convert(rgb.data(), width, photo.pixel(0, y));
  }
  return photo;
}

}  // namespace

// The others load nothing.
void LoadPhotoDecoders() { UseHeifCodecs(); }

const PhotoFormat kHeifFormat = {ImageFormat::kHeif, "HEIC, AVIF", IsHeif, ReadHeifInfo,
                                 DecodeHeif};

}  // namespace litags
