#include "engine/io/jpeg_decode.h"

// jpeglib.h needs FILE and size_t to be declared before it.
#include <csetjmp>
#include <cstddef>
#include <cstdio>
#include <string>

#include <jerror.h>
#include <jpeglib.h>

#include "engine/io/io_error.h"

namespace litags {
namespace {

// Progressive photos have about ten scans. Each costs a pass over the picture, so a small file with
// thousands of them would hold a core for hours.
constexpr int kMaxScans = 100;

enum class Damage { kNone, kTruncated, kCorrupt, kUnsupported };

// libjpeg's handlers reach this through cinfo->err, its first member.
struct ErrorState {
  jpeg_error_mgr manager;
  std::jmp_buf escape;
  Damage damage;
  char message[JMSG_LENGTH_MAX];
};

ErrorState* StateOf(j_common_ptr cinfo) { return reinterpret_cast<ErrorState*>(cinfo->err); }

[[noreturn]] void Refuse(ErrorState* state, const char* why) {
  state->damage = Damage::kUnsupported;
  std::snprintf(state->message, sizeof(state->message), "%s", why);
  std::longjmp(state->escape, 1);
}

[[noreturn]] void OnError(j_common_ptr cinfo) {
  ErrorState* state = StateOf(cinfo);
  if (state->damage == Damage::kNone) {
    state->damage = Damage::kCorrupt;
    cinfo->err->format_message(cinfo, state->message);
  }
  std::longjmp(state->escape, 1);
}

// Warnings have level -1. Only those that mean lost pixels count: some cameras write harmless
// extra bytes between segments.
void OnMessage(j_common_ptr cinfo, int level) {
  ErrorState* state = StateOf(cinfo);
  if (level >= 0 || state->damage != Damage::kNone) return;
  switch (cinfo->err->msg_code) {
    case JWRN_JPEG_EOF:
    case JWRN_HIT_MARKER:
      state->damage = Damage::kTruncated;
      break;
    case JWRN_HUFF_BAD_CODE:
    case JWRN_MUST_RESYNC:
      state->damage = Damage::kCorrupt;
      break;
    default:
      return;
  }
  cinfo->err->format_message(cinfo, state->message);
}

void OnOutputMessage(j_common_ptr) {}  // by default libjpeg prints to stderr

void OnProgress(j_common_ptr cinfo) {
  if (reinterpret_cast<j_decompress_ptr>(cinfo)->input_scan_number > kMaxScans) {
    Refuse(StateOf(cinfo), "a progressive JPEG with very many scans; save it as a baseline JPEG");
  }
}

// Everything between setjmp and longjmp: only plain C objects live here, as longjmp runs no
// destructors. Returns false after an error; `rgb` holds 3 * width * height bytes.
bool Decode(std::string_view bytes, const ImageInfo& info, ErrorState* state, uint8_t* rgb) {
  jpeg_decompress_struct cinfo;
  jpeg_progress_mgr progress = {};
  cinfo.err = jpeg_std_error(&state->manager);
  state->manager.error_exit = OnError;
  state->manager.emit_message = OnMessage;
  state->manager.output_message = OnOutputMessage;
  state->damage = Damage::kNone;
  state->message[0] = '\0';
  progress.progress_monitor = OnProgress;
  if (setjmp(state->escape) != 0) {
    jpeg_destroy_decompress(&cinfo);
    return false;
  }
  jpeg_create_decompress(&cinfo);
  cinfo.progress = &progress;
  jpeg_mem_src(&cinfo, reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size());
  jpeg_read_header(&cinfo, TRUE);
  if (cinfo.image_width != JDIMENSION(info.width) ||
      cinfo.image_height != JDIMENSION(info.height)) {
    ERREXIT(&cinfo, JERR_SOF_DUPLICATE);
  }
  if (cinfo.jpeg_color_space == JCS_CMYK || cinfo.jpeg_color_space == JCS_YCCK) {
    Refuse(state, "a CMYK JPEG; convert it to RGB");
  }
  // Its decoder reads zeros past the end without a warning, so damage would pass unseen.
  if (cinfo.arith_code) Refuse(state, "an arithmetic-coded JPEG; save it as a baseline JPEG");
  cinfo.out_color_space = JCS_RGB;
  jpeg_start_decompress(&cinfo);
  while (cinfo.output_scanline < cinfo.output_height) {
    JSAMPROW row = rgb + size_t{3} * info.width * cinfo.output_scanline;
    jpeg_read_scanlines(&cinfo, &row, 1);
  }
  jpeg_finish_decompress(&cinfo);  // reads on to the end-of-image marker, so its absence shows
  jpeg_destroy_decompress(&cinfo);
  return true;
}

}  // namespace

absl::StatusOr<ImageU8> DecodeJpegRgb(std::string_view bytes, const ImageInfo& info,
                                      std::string_view field) {
  ImageU8 image(info.width, info.height);
  ErrorState state;
  const bool decoded = Decode(bytes, info, &state, image.data.data());
  if (decoded && state.damage == Damage::kNone) return image;
  const std::string detail = absl::StrCat("(", state.message, "); send the whole file again");
  switch (state.damage) {
    case Damage::kTruncated:
      return InvalidField("IMAGE_TRUNCATED", field,
                          absl::StrCat("the JPEG's data end before the picture does ", detail));
    case Damage::kUnsupported:
      return InvalidField("IMAGE_UNSUPPORTED", field, state.message);
    default:
      return InvalidField("IMAGE_CORRUPT", field,
                          absl::StrCat("the JPEG cannot be decoded ", detail));
  }
}

}  // namespace litags
