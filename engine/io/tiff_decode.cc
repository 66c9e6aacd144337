// The first page of a TIFF, by libtiff: 8 and 16 bits, and floating point, which is light.
#include <tiffio.h>

#include <algorithm>
#include <cstdarg>
#include <cstdio>
#include <cstring>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "absl/strings/str_format.h"
#include "engine/io/color_space.h"
#include "engine/io/image_header.h"
#include "engine/io/io_error.h"
#include "engine/io/photo_format.h"

namespace litags {
namespace {

// A page of 64 megapixels with three channels in floating point has 768 MiB.
constexpr tmsize_t kMaxAllocation = tmsize_t{1} << 30;
constexpr int kMaxSamples = 8;  // of a pixel: colours and what else is stored

// A TIFF in memory. libtiff reports to it, not to stderr.
class TiffFile {
 public:
  explicit TiffFile(std::string_view bytes) : bytes_(bytes) {
    const std::unique_ptr<TIFFOpenOptions, void (*)(TIFFOpenOptions*)> options(
        TIFFOpenOptionsAlloc(), TIFFOpenOptionsFree);
    TIFFOpenOptionsSetMaxSingleMemAlloc(options.get(), kMaxAllocation);
    TIFFOpenOptionsSetErrorHandlerExtR(options.get(), OnError, this);
    TIFFOpenOptionsSetWarningHandlerExtR(options.get(), OnWarning, this);
    tiff_ = TIFFClientOpenExt("photo", "rm", this, Read, Write, Seek, Close, Size, nullptr, nullptr,
                              options.get());
  }
  ~TiffFile() {
    if (tiff_ != nullptr) TIFFClose(tiff_);
  }
  TiffFile(const TiffFile&) = delete;
  TiffFile& operator=(const TiffFile&) = delete;

  TIFF* get() const { return tiff_; }

  uint32_t Tag(uint32_t tag) const {  // of 32 bits, 0 if it is not there
    uint32_t value = 0;
    TIFFGetField(tiff_, tag, &value);
    return value;
  }
  uint16_t Short(uint32_t tag) const {
    uint16_t value = 0;
    TIFFGetFieldDefaulted(tiff_, tag, &value);
    return value;
  }

  absl::Status Error(std::string_view field) const {
    if (beyond_end_) {
      return InvalidField("IMAGE_TRUNCATED", field,
                          "the TIFF ends early; send the whole file again");
    }
    return InvalidField("IMAGE_CORRUPT", field,
                        absl::StrCat("the TIFF cannot be decoded (", message_,
                                     "); save it again or convert it to PNG"));
  }

 private:
  static TiffFile* Self(void* self) { return static_cast<TiffFile*>(self); }

  static int OnError(TIFF*, void* self, const char*, const char* format, va_list arguments) {
    char text[200];
    std::vsnprintf(text, sizeof(text), format, arguments);
    if (Self(self)->message_.empty()) Self(self)->message_ = text;
    return 1;  // no other handler is asked
  }
  static int OnWarning(TIFF*, void*, const char*, const char*, va_list) { return 1; }

  static tmsize_t Read(thandle_t handle, void* out, tmsize_t size) {
    TiffFile* self = Self(handle);
    const uint64_t all = self->bytes_.size();
    const uint64_t left = self->at_ < all ? all - self->at_ : 0;
    const uint64_t n = std::min<uint64_t>(left, static_cast<uint64_t>(size));
    if (n < static_cast<uint64_t>(size)) self->beyond_end_ = true;
    if (n > 0) std::memcpy(out, self->bytes_.data() + self->at_, n);
    self->at_ += n;
    return static_cast<tmsize_t>(n);
  }
  static tmsize_t Write(thandle_t, void*, tmsize_t) { return 0; }
  static toff_t Seek(thandle_t handle, toff_t offset, int whence) {
    TiffFile* self = Self(handle);
    self->at_ = whence == SEEK_SET   ? offset
                : whence == SEEK_CUR ? self->at_ + offset
                                     : self->bytes_.size() + offset;
    return self->at_;
  }
  static int Close(thandle_t) { return 0; }
  static toff_t Size(thandle_t handle) { return Self(handle)->bytes_.size(); }

  const std::string_view bytes_;
  uint64_t at_ = 0;
  bool beyond_end_ = false;
  std::string message_;
  TIFF* tiff_ = nullptr;
};

bool IsTiff(std::string_view bytes) {
  constexpr std::string_view kMagics[] = {{"II*\0", 4}, {"MM\0*", 4}, {"II+\0", 4}, {"MM\0+", 4}};
  return std::any_of(std::begin(kMagics), std::end(kMagics),
                     [&](std::string_view magic) { return bytes.starts_with(magic); });
}

// How samples lie in the file.
struct Layout {
  int colors = 3;   // 1 grey, 3 RGB, 4 CMYK
  int samples = 3;  // of a pixel, with what is no colour
  int bits = 8;
  bool is_float = false;
  bool inverted = false;  // 0 is white
  bool planar = false;    // a plane per sample
};

absl::StatusOr<Layout> LayoutOf(const TiffFile& file, std::string_view field) {
  const auto unsupported = [&](std::string_view what) {
    return InvalidField("IMAGE_UNSUPPORTED", field,
                        absl::StrCat("a TIFF ", Absl(what), "; save it as RGB of 8 or 16 bits"));
  };
  constexpr uint16_t kCompressions[] = {
      COMPRESSION_NONE,     COMPRESSION_LZW,  COMPRESSION_ADOBE_DEFLATE, COMPRESSION_DEFLATE,
      COMPRESSION_PACKBITS, COMPRESSION_JPEG, COMPRESSION_ZSTD};
  const uint16_t compression = file.Short(TIFFTAG_COMPRESSION);
  if (std::find(std::begin(kCompressions), std::end(kCompressions), compression) ==
      std::end(kCompressions)) {
    return unsupported(absl::StrCat("of compression ", compression));
  }
  Layout layout;
  switch (file.Short(TIFFTAG_PHOTOMETRIC)) {
    case PHOTOMETRIC_MINISWHITE:
      layout.inverted = true;
      [[fallthrough]];
    case PHOTOMETRIC_MINISBLACK:
      layout.colors = 1;
      break;
    case PHOTOMETRIC_RGB:
      break;
    case PHOTOMETRIC_YCBCR:
      if (compression != COMPRESSION_JPEG) return unsupported("in YCbCr");
      // libjpeg converts it.
      TIFFSetField(file.get(), TIFFTAG_JPEGCOLORMODE, JPEGCOLORMODE_RGB);
      break;
    case PHOTOMETRIC_SEPARATED:
      layout.colors = 4;
      break;
    default:
      return unsupported(
          absl::StrCat("of photometric interpretation ", file.Short(TIFFTAG_PHOTOMETRIC)));
  }
  layout.samples = file.Short(TIFFTAG_SAMPLESPERPIXEL);
  layout.bits = file.Short(TIFFTAG_BITSPERSAMPLE);
  layout.planar = file.Short(TIFFTAG_PLANARCONFIG) == PLANARCONFIG_SEPARATE;
  const uint16_t kind = file.Short(TIFFTAG_SAMPLEFORMAT);
  layout.is_float = kind == SAMPLEFORMAT_IEEEFP;
  if (layout.samples < layout.colors || layout.samples > kMaxSamples) {
    return unsupported(absl::StrCat("with ", layout.samples, " samples a pixel"));
  }
  const bool whole = kind == SAMPLEFORMAT_UINT && (layout.bits == 8 || layout.bits == 16);
  if (!whole && !(layout.is_float && layout.bits == 32)) {
    return unsupported(absl::StrCat("of ", layout.bits, " bits a sample",
                                    layout.is_float ? " in floating point" : ""));
  }
  return layout;
}

absl::StatusOr<ImageInfo> ReadTiffInfo(std::string_view bytes, std::string_view field) {
  const TiffFile file(bytes);
  if (file.get() == nullptr) return file.Error(field);
  LITAGS_ASSIGN_OR_RETURN(const Layout layout, LayoutOf(file, field));
  ImageInfo info;
  info.format = ImageFormat::kTiff;
  const uint32_t width = file.Tag(TIFFTAG_IMAGEWIDTH), height = file.Tag(TIFFTAG_IMAGELENGTH);
  if (width == 0 || height == 0 || width > INT32_MAX || height > INT32_MAX) {
    return InvalidField("IMAGE_CORRUPT", field, "the TIFF states an impossible size");
  }
  info.width = static_cast<int>(width);
  info.height = static_cast<int>(height);
  info.bit_depth = layout.bits;
  const int orientation = file.Short(TIFFTAG_ORIENTATION);
  if (orientation >= 1 && orientation <= 8) info.orientation = orientation;
  ReadExif(bytes, &info);
  return info;
}

absl::StatusOr<ColorSpace> ColorSpaceOf(const TiffFile& file, const Layout& layout,
                                        std::string_view field) {
  uint32_t size = 0;
  const char* data = nullptr;
  std::optional<ColorSpace> space;
  if (TIFFGetField(file.get(), TIFFTAG_ICCPROFILE, &size, &data) == 1) {
    space = ColorSpace::FromIcc({data, size}, layout.colors);
  }
  if (space.has_value()) return *std::move(space);
  if (layout.colors == 4) {
    return InvalidField("IMAGE_UNSUPPORTED", field,
                        "a CMYK TIFF without a usable colour profile; convert it to RGB");
  }
  return layout.is_float ? ColorSpace::Gamma(1, layout.colors) : ColorSpace::Srgb(layout.colors);
}

// Values in floating point that are no light of which 1 is white, but temperatures, say.
class ValueRange {
 public:
  void Add(const float* values, size_t n) {
    for (size_t i = 0; i < n; ++i) {
      least_ = std::min(least_, values[i]);
      most_ = std::max(most_, values[i]);
      above_ += values[i] > kMostLight;
    }
    all_ += n;
  }

  absl::Status Check(std::string_view field) const {
    if (2 * above_ <= all_) return absl::OkStatus();
    return InvalidField(
        "IMAGE_UNSUPPORTED", field,
        absl::StrFormat(
            "a TIFF in floating point with values from %.4g to %.4g, most of them above "
            "%g, where 1 is white; divide the values of all photos by one number. "
            "Temperatures are no light: send the photos of the camera beside the "
            "thermal one",
            least_, most_, kMostLight));
  }

 private:
  static constexpr float kMostLight = 4.9f;  // that a photo's samples hold
  float least_ = std::numeric_limits<float>::infinity(), most_ = -least_;
  uint64_t above_ = 0, all_ = 0;
};

// A strip or tile: all its samples, or those of one plane.
class Block {
 public:
  Block(const TiffFile& file, const Layout& layout) : layout_(layout) {
    TIFF* tiff = file.get();
    tiled_ = TIFFIsTiled(tiff) != 0;
    width_ = tiled_ ? file.Tag(TIFFTAG_TILEWIDTH) : file.Tag(TIFFTAG_IMAGEWIDTH);
    height_ = tiled_
                  ? file.Tag(TIFFTAG_TILELENGTH)
                  : std::min(file.Tag(TIFFTAG_ROWSPERSTRIP) == 0 ? UINT32_MAX
                                                                 : file.Tag(TIFFTAG_ROWSPERSTRIP),
                             file.Tag(TIFFTAG_IMAGELENGTH));
    size_ = tiled_ ? TIFFTileSize(tiff) : TIFFStripSize(tiff);
    data_.resize(layout.planar ? layout.colors : 1);
  }

  // libtiff's size must be that of so many samples, which rules out overflow, too.
  bool IsSane() const {
    const uint64_t samples = uint64_t{width_} * height_ * (layout_.planar ? 1 : layout_.samples);
    return width_ > 0 && height_ > 0 && size_ > 0 &&
           size_ <= kMaxAllocation / static_cast<tmsize_t>(data_.size()) &&
           samples * (layout_.bits / 8) == static_cast<uint64_t>(size_);
  }
  uint32_t width() const { return width_; }
  uint32_t height() const { return height_; }

  bool Read(TIFF* tiff, uint32_t x, uint32_t y) {
    for (size_t p = 0; p < data_.size(); ++p) {
      data_[p].resize(size_);
      const uint16_t plane = static_cast<uint16_t>(p);
      const tmsize_t read = tiled_
                                ? TIFFReadEncodedTile(tiff, TIFFComputeTile(tiff, x, y, 0, plane),
                                                      data_[p].data(), size_)
                                : TIFFReadEncodedStrip(tiff, TIFFComputeStrip(tiff, y, plane),
                                                       data_[p].data(), size_);
      if (read < 0) return false;
    }
    return true;
  }

  // Codes of the colours of `n` pixels of a row.
  void Row(uint32_t row, uint32_t n, float* out) const {
    const size_t step = layout_.planar ? 1 : layout_.samples;
    for (int c = 0; c < layout_.colors; ++c) {
      const std::vector<uint8_t>& data = data_[layout_.planar ? c : 0];
      size_t at = size_t{row} * width_ * step + (layout_.planar ? 0 : c);
      for (uint32_t x = 0; x < n; ++x, at += step) {
        const float code = Sample(data.data(), at);
        out[size_t{x} * layout_.colors + c] = layout_.inverted ? 1 - code : code;
      }
    }
  }

 private:
  float Sample(const uint8_t* data, size_t at) const {
    if (layout_.bits == 8) return data[at] / 255.0f;
    if (layout_.bits == 16) {
      uint16_t code;
      std::memcpy(&code, data + 2 * at, 2);
      return code / 65535.0f;
    }
    float value;
    std::memcpy(&value, data + 4 * at, 4);
    return value;
  }

  const Layout layout_;
  bool tiled_ = false;
  uint32_t width_ = 0, height_ = 0;
  tmsize_t size_ = 0;
  std::vector<std::vector<uint8_t>> data_;  // by plane
};

absl::StatusOr<Photo> DecodeTiff(std::string_view bytes, const ImageInfo& info,
                                 std::string_view field) {
  const TiffFile file(bytes);
  if (file.get() == nullptr) return file.Error(field);
  LITAGS_ASSIGN_OR_RETURN(const Layout layout, LayoutOf(file, field));
  LITAGS_ASSIGN_OR_RETURN(const ColorSpace space, ColorSpaceOf(file, layout, field));
  Block block(file, layout);
  if (!block.IsSane()) {
    return InvalidField("IMAGE_CORRUPT", field, "the TIFF's strips or tiles have no possible size");
  }
  Photo photo(info.width, info.height);
  std::vector<float> codes(size_t(layout.colors) * block.width());
  ValueRange range;
  const uint32_t width = photo.width, height = photo.height;
  for (uint32_t y = 0; y < height; y += block.height()) {
    for (uint32_t x = 0; x < width; x += block.width()) {
      if (!block.Read(file.get(), x, y)) return file.Error(field);
      const uint32_t n = std::min(block.width(), width - x);
      for (uint32_t row = 0; row < std::min(block.height(), height - y); ++row) {
        block.Row(row, n, codes.data());
        if (layout.is_float) range.Add(codes.data(), size_t{n} * layout.colors);
        space.Convert(codes.data(), n, photo.pixel(static_cast<int>(x), static_cast<int>(y + row)));
      }
    }
  }
  LITAGS_RETURN_IF_ERROR(range.Check(field));
  return photo;
}

}  // namespace

const PhotoFormat kTiffFormat = {ImageFormat::kTiff, "TIFF", IsTiff, ReadTiffInfo, DecodeTiff};

}  // namespace litags
