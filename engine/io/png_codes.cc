#include "engine/io/png_codes.h"

// png.h needs jmp_buf to be declared before it.
#include <csetjmp>

#include <png.h>
#include <zlib.h>

#include <algorithm>
#include <bit>
#include <cstdio>
#include <vector>

#include "absl/strings/str_cat.h"
#include "engine/io/image_header.h"
#include "engine/io/io_error.h"

namespace litags {
namespace {

// Where libpng leaves off, and why.
struct Escape {
  std::jmp_buf jump;
  char message[128] = "";
};

[[noreturn]] void OnError(png_structp png, png_const_charp why) {
  auto* escape = static_cast<Escape*>(png_get_error_ptr(png));
  std::snprintf(escape->message, sizeof(escape->message), "%s", why);
  std::longjmp(escape->jump, 1);
}

void OnWarning(png_structp, png_const_charp) {}  // by default libpng prints to stderr

void Read(png_structp png, png_bytep to, size_t size) {
  auto* left = static_cast<std::string_view*>(png_get_io_ptr(png));
  if (left->size() < size) png_error(png, "the data end early");
  std::copy_n(left->data(), size, reinterpret_cast<char*>(to));
  left->remove_prefix(size);
}

void Append(png_structp png, png_bytep from, size_t size) {
  static_cast<std::string*>(png_get_io_ptr(png))->append(reinterpret_cast<char*>(from), size);
}

void Flush(png_structp) {}

// In each function that calls setjmp only plain C objects live after it, as longjmp runs no
// destructors.
class PngReader {
 public:
  PngReader() : png_(png_create_read_struct(PNG_LIBPNG_VER_STRING, &escape_, OnError, OnWarning)) {
    if (png_ != nullptr) info_ = png_create_info_struct(png_);
  }
  ~PngReader() { png_destroy_read_struct(&png_, &info_, nullptr); }
  PngReader(const PngReader&) = delete;
  PngReader& operator=(const PngReader&) = delete;

  bool Read(std::string_view bytes, const ImageInfo& info, PngChannels channels,
            TakePngRow take_row) {
    left_ = bytes;
    if (info_ == nullptr || !ReadHeader(info, channels)) return false;
    const size_t row_bytes = png_get_rowbytes(png_, info_);
    // Only the passes of an interlaced picture need all of its rows at once.
    rows_.resize(row_bytes * (passes_ > 1 ? shape_.height : 1));
    codes_.resize(size_t(shape_.width) * shape_.channels);
    return ReadRows(row_bytes, take_row);
  }

  const char* why() const { return escape_.message; }

 private:
  bool ReadHeader(const ImageInfo& info, PngChannels channels) {
    if (setjmp(escape_.jump) != 0) return false;
    png_set_read_fn(png_, &left_, litags::Read);
    // All but the header, palette, transparency, pixels and end.
    png_set_keep_unknown_chunks(png_, PNG_HANDLE_CHUNK_NEVER, nullptr, -1);
    png_read_info(png_, info_);
    const int type = png_get_color_type(png_, info_), bits = png_get_bit_depth(png_, info_);
    if (type == PNG_COLOR_TYPE_PALETTE) png_set_palette_to_rgb(png_);
    if (type == PNG_COLOR_TYPE_GRAY && bits < 8) png_set_expand_gray_1_2_4_to_8(png_);
    if (channels == PngChannels::kAll) {
      if (png_get_valid(png_, info_, PNG_INFO_tRNS) != 0) png_set_tRNS_to_alpha(png_);
    } else {
      png_set_strip_alpha(png_);
      if ((type & PNG_COLOR_MASK_COLOR) == 0) png_set_gray_to_rgb(png_);
    }
    if (bits == 16 && std::endian::native == std::endian::little) png_set_swap(png_);
    passes_ = png_set_interlace_handling(png_);
    png_read_update_info(png_, info_);
    shape_.width = static_cast<int>(png_get_image_width(png_, info_));
    shape_.height = static_cast<int>(png_get_image_height(png_, info_));
    if (shape_.width != info.width || shape_.height != info.height) {
      png_error(png_, "it states two sizes");
    }
    shape_.channels = png_get_channels(png_, info_);
    shape_.white = bits == 16 ? 65535 : 255;
    return true;
  }

  bool ReadRows(size_t row_bytes, TakePngRow take_row) {
    if (setjmp(escape_.jump) != 0) return false;
    for (int pass = 0; pass + 1 < passes_; ++pass) {
      for (int y = 0; y < shape_.height; ++y) png_read_row(png_, &rows_[y * row_bytes], nullptr);
    }
    for (int y = 0; y < shape_.height; ++y) {
      uint8_t* row = &rows_[passes_ > 1 ? y * row_bytes : 0];
      png_read_row(png_, row, nullptr);
      take_row(shape_, y, Codes(row));
    }
    png_read_end(png_, nullptr);
    return true;
  }

  const uint16_t* Codes(const uint8_t* row) {
    if (shape_.white > 255) {
      std::copy_n(row, 2 * codes_.size(), reinterpret_cast<uint8_t*>(codes_.data()));
    } else {
      std::copy_n(row, codes_.size(), codes_.data());
    }
    return codes_.data();
  }

  Escape escape_;
  png_structp png_ = nullptr;
  png_infop info_ = nullptr;
  std::string_view left_;
  int passes_ = 1;
  PngShape shape_;
  std::vector<uint8_t> rows_;
  std::vector<uint16_t> codes_;  // of a row
};

class PngWriter {
 public:
  PngWriter() : png_(png_create_write_struct(PNG_LIBPNG_VER_STRING, &escape_, OnError, OnWarning)) {
    if (png_ != nullptr) info_ = png_create_info_struct(png_);
  }
  ~PngWriter() { png_destroy_write_struct(&png_, &info_); }
  PngWriter(const PngWriter&) = delete;
  PngWriter& operator=(const PngWriter&) = delete;

  bool Write(const uint8_t* codes, const PngShape& shape, PngSpeed speed, std::string* out) {
    if (info_ == nullptr || setjmp(escape_.jump) != 0) return false;
    const int bits = shape.white > 255 ? 16 : 8;
    const int type = shape.channels == 1   ? PNG_COLOR_TYPE_GRAY
                     : shape.channels == 3 ? PNG_COLOR_TYPE_RGB
                                           : PNG_COLOR_TYPE_RGB_ALPHA;
    png_set_write_fn(png_, out, Append, Flush);
    png_set_compression_level(png_, Z_BEST_SPEED);
    if (speed == PngSpeed::kPicture) {
      png_set_filter(png_, PNG_FILTER_TYPE_BASE, PNG_FILTER_SUB);
      png_set_compression_strategy(png_, Z_RLE);
    } else {
      png_set_compression_strategy(png_, Z_DEFAULT_STRATEGY);
    }
    png_set_IHDR(png_, info_, shape.width, shape.height, bits, type, PNG_INTERLACE_NONE,
                 PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    png_write_info(png_, info_);
    if (bits == 16 && std::endian::native == std::endian::little) png_set_swap(png_);
    const size_t row_bytes = size_t(shape.width) * shape.channels * (bits / 8);
    for (int y = 0; y < shape.height; ++y) png_write_row(png_, codes + y * row_bytes);
    png_write_end(png_, info_);
    return true;
  }

  const char* why() const { return escape_.message; }

 private:
  Escape escape_;
  png_structp png_ = nullptr;
  png_infop info_ = nullptr;
};

absl::StatusOr<std::string> Encode(const uint8_t* codes, const PngShape& shape, PngSpeed speed) {
  if (shape.width <= 0 || shape.height <= 0) {
    return InvalidField("IMAGE_EMPTY", "image", "there are no pixels to encode");
  }
  std::string out;
  PngWriter writer;
  if (writer.Write(codes, shape, speed, &out)) return out;
  return FieldError(absl::StatusCode::kInternal, "IMAGE_ENCODE_FAILED", "image",
                    absl::StrCat("libpng: ", writer.why()));
}

}  // namespace

absl::Status ReadPngCodes(std::string_view bytes, PngChannels channels, std::string_view field,
                          TakePngRow take_row) {
  LITAGS_ASSIGN_OR_RETURN(const ImageInfo info, ParsePngHeader(bytes, field));
  LITAGS_RETURN_IF_ERROR(CheckPngComplete(bytes, field));
  PngReader reader;
  if (reader.Read(bytes, info, channels, take_row)) return absl::OkStatus();
  return InvalidField(
      "IMAGE_CORRUPT", field,
      absl::StrCat("the PNG cannot be decoded (", reader.why(), "); send the file again"));
}

absl::StatusOr<std::string> EncodePngCodes(const uint8_t* codes, int width, int height,
                                           int channels) {
  return Encode(codes, {width, height, channels, 255}, PngSpeed::kPicture);
}

absl::StatusOr<std::string> EncodePngCodes(const uint16_t* codes, int width, int height,
                                           int channels, PngSpeed speed) {
  return Encode(reinterpret_cast<const uint8_t*>(codes), {width, height, channels, 65535}, speed);
}

std::string WithPngChunk(std::string png, const std::string& type, const std::string& data) {
  constexpr size_t kHeader = 33;  // signature and IHDR
  const auto big = [](uint32_t n) {
    return std::string{char(n >> 24), char(n >> 16), char(n >> 8), char(n)};
  };
  const std::string chunk = type + data;
  const auto crc =
      static_cast<uint32_t>(crc32_z(0, reinterpret_cast<const Bytef*>(chunk.data()), chunk.size()));
  return std::move(png.insert(kHeader, big(static_cast<uint32_t>(data.size())) + chunk + big(crc)));
}

}  // namespace litags
