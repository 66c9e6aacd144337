#include "engine/io/jpeg_coefficients.h"

#include <jerror.h>

#include "absl/strings/str_cat.h"
#include "engine/io/io_error.h"

namespace litags {
namespace {

// Progressive photos have about ten scans. Each costs a pass over the picture, so a small file with
// thousands of them would hold a core for hours.
constexpr int kMaxScans = 100;

void OnOutputMessage(j_common_ptr) {}  // by default libjpeg prints to stderr

}  // namespace

JpegCoefficients::ErrorState* JpegCoefficients::StateOf(j_common_ptr cinfo) {
  return reinterpret_cast<ErrorState*>(cinfo->err);
}

void JpegCoefficients::Refuse(ErrorState* state, const char* why) {
  state->damage = Damage::kUnsupported;
  std::snprintf(state->message, sizeof(state->message), "%s", why);
  std::longjmp(state->escape, 1);
}

void JpegCoefficients::OnError(j_common_ptr cinfo) {
  ErrorState* state = StateOf(cinfo);
  if (state->damage == Damage::kNone) {
    state->damage = state->ended ? Damage::kTruncated : Damage::kCorrupt;
    cinfo->err->format_message(cinfo, state->message);
  }
  std::longjmp(state->escape, 1);
}

// Warnings have level -1. Only those that mean lost pixels count: some cameras write harmless
// extra bytes between segments.
void JpegCoefficients::OnMessage(j_common_ptr cinfo, int level) {
  ErrorState* state = StateOf(cinfo);
  if (level >= 0 || state->damage != Damage::kNone) return;
  switch (cinfo->err->msg_code) {
    // The end mark may be all that is missing: libjpeg puts one there. What needs data beyond it
    // meets it too early, and scans that never came show in HasAllScans().
    case JWRN_JPEG_EOF:
      state->ended = true;
      return;
    case JWRN_HIT_MARKER:
      state->damage = Damage::kTruncated;
      break;
    case JWRN_HUFF_BAD_CODE:
    case JWRN_MUST_RESYNC:
      state->damage = state->ended ? Damage::kTruncated : Damage::kCorrupt;
      break;
    default:
      return;
  }
  cinfo->err->format_message(cinfo, state->message);
}

void JpegCoefficients::OnProgress(j_common_ptr cinfo) {
  if (reinterpret_cast<j_decompress_ptr>(cinfo)->input_scan_number > kMaxScans) {
    Refuse(StateOf(cinfo), "a progressive JPEG with very many scans; save it as a baseline JPEG");
  }
}

JpegCoefficients::JpegCoefficients() {
  cinfo_.err = jpeg_std_error(&state_.manager);
  state_.manager.error_exit = OnError;
  state_.manager.emit_message = OnMessage;
  state_.manager.output_message = OnOutputMessage;
  progress_.progress_monitor = OnProgress;
}

JpegCoefficients::~JpegCoefficients() { jpeg_destroy_decompress(&cinfo_); }

// Whether every coefficient came to its last bit. Of a sequential JPEG there is no such table: its
// last scan must hold all components.
bool JpegCoefficients::HasAllScans() const {
  if (cinfo_.coef_bits == nullptr) return cinfo_.comps_in_scan == cinfo_.num_components;
  for (int c = 0; c < cinfo_.num_components; ++c) {
    for (int k = 0; k < DCTSIZE2; ++k) {
      if (cinfo_.coef_bits[c][k] != 0) return false;
    }
  }
  return true;
}

// Only plain C objects live between setjmp and longjmp, as longjmp runs no destructors. Returns
// false after an error.
bool JpegCoefficients::ReadAll(std::string_view bytes, const ImageInfo& info) {
  if (setjmp(state_.escape) != 0) return false;
  jpeg_create_decompress(&cinfo_);
  cinfo_.progress = &progress_;
  jpeg_mem_src(&cinfo_, reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size());
  jpeg_read_header(&cinfo_, TRUE);
  if (cinfo_.image_width != JDIMENSION(info.width) ||
      cinfo_.image_height != JDIMENSION(info.height)) {
    ERREXIT(&cinfo_, JERR_SOF_DUPLICATE);
  }
  const bool cmyk = cinfo_.jpeg_color_space == JCS_CMYK || cinfo_.jpeg_color_space == JCS_YCCK;
  if (cinfo_.num_components != 1 && cinfo_.num_components != 3 && !cmyk) {
    Refuse(&state_, "a JPEG that is neither grey nor colour; convert it to RGB");
  }
  // Its decoder reads zeros past the end without a warning, so damage would pass unseen.
  if (cinfo_.arith_code) Refuse(&state_, "an arithmetic-coded JPEG; save it as a baseline JPEG");
  arrays_ = jpeg_read_coefficients(&cinfo_);
  if (state_.ended && !HasAllScans()) {
    state_.damage = Damage::kTruncated;
    std::snprintf(state_.message, sizeof(state_.message), "scans are missing");
  }
  for (int c = 0; c < cinfo_.num_components; ++c) {
    if (cinfo_.comp_info[c].quant_table == nullptr) ERREXIT(&cinfo_, JERR_NO_QUANT_TABLE);
  }
  return true;
}

absl::Status JpegCoefficients::Read(std::string_view bytes, const ImageInfo& info,
                                    std::string_view field) {
  if (ReadAll(bytes, info) && state_.damage == Damage::kNone) return absl::OkStatus();
  const std::string detail = absl::StrCat("(", state_.message, "); send the whole file again");
  switch (state_.damage) {
    case Damage::kTruncated:
      return InvalidField("IMAGE_TRUNCATED", field,
                          absl::StrCat("the JPEG's data end before the picture does ", detail));
    case Damage::kUnsupported:
      return InvalidField("IMAGE_UNSUPPORTED", field, state_.message);
    default:
      return InvalidField("IMAGE_CORRUPT", field,
                          absl::StrCat("the JPEG cannot be decoded ", detail));
  }
}

const JBLOCK* JpegCoefficients::BlockRow(int component, int row) {
  if (setjmp(state_.escape) != 0) return nullptr;
  return cinfo_.mem->access_virt_barray(reinterpret_cast<j_common_ptr>(&cinfo_), arrays_[component],
                                        row, 1, FALSE)[0];
}

}  // namespace litags
