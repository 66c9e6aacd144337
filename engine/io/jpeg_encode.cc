// JPEG by libjpeg: baseline, chroma at half size.

// jpeglib.h needs FILE and size_t to be declared before it.
#include <csetjmp>
#include <cstddef>
#include <cstdio>
#include <cstdlib>

#include <jpeglib.h>

#include "absl/strings/str_cat.h"
#include "engine/io/io_error.h"
#include "engine/io/picture_io.h"

namespace litags {
namespace {

struct Escape {
  jpeg_error_mgr manager;  // first, so that libjpeg's handlers reach the others through it
  std::jmp_buf jump;
  char message[JMSG_LENGTH_MAX];
};

[[noreturn]] void OnError(j_common_ptr cinfo) {
  auto* escape = reinterpret_cast<Escape*>(cinfo->err);
  cinfo->err->format_message(cinfo, escape->message);
  std::longjmp(escape->jump, 1);
}

class JpegWriter {
 public:
  JpegWriter() {
    cinfo_.err = jpeg_std_error(&escape_.manager);
    escape_.manager.error_exit = OnError;
  }
  ~JpegWriter() {
    jpeg_destroy_compress(&cinfo_);
    std::free(bytes_);
  }
  JpegWriter(const JpegWriter&) = delete;
  JpegWriter& operator=(const JpegWriter&) = delete;

  // Only plain C objects live after setjmp, as longjmp runs no destructors.
  bool Write(const ImageU8& image, int quality) {
    if (setjmp(escape_.jump) != 0) return false;
    jpeg_create_compress(&cinfo_);
    jpeg_mem_dest(&cinfo_, &bytes_, &size_);
    cinfo_.image_width = image.width;
    cinfo_.image_height = image.height;
    cinfo_.input_components = 3;
    cinfo_.in_color_space = JCS_RGB;
    jpeg_set_defaults(&cinfo_);
    jpeg_set_quality(&cinfo_, quality, TRUE);
    jpeg_start_compress(&cinfo_, TRUE);
    while (cinfo_.next_scanline < cinfo_.image_height) {
      auto* row = const_cast<uint8_t*>(&image.data[size_t(3) * image.width * cinfo_.next_scanline]);
      jpeg_write_scanlines(&cinfo_, &row, 1);
    }
    jpeg_finish_compress(&cinfo_);
    return true;
  }

  std::string bytes() const { return std::string(reinterpret_cast<char*>(bytes_), size_); }
  const char* why() const { return escape_.message; }

 private:
  jpeg_compress_struct cinfo_ = {};
  Escape escape_ = {};
  unsigned char* bytes_ = nullptr;
  unsigned long size_ = 0;
};

}  // namespace

absl::StatusOr<std::string> EncodeJpeg(const ImageU8& image, int quality) {
  if (image.empty()) {
    return InvalidField("IMAGE_EMPTY", "image", "there are no pixels to encode");
  }
  JpegWriter writer;
  if (writer.Write(image, quality)) return writer.bytes();
  return FieldError(absl::StatusCode::kInternal, "IMAGE_ENCODE_FAILED", "image",
                    absl::StrCat("libjpeg: ", writer.why()));
}

}  // namespace litags
