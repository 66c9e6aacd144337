// Inside this module: the DCT coefficients of a JPEG, read by libjpeg.
#ifndef LITAGS_ENGINE_IO_JPEG_COEFFICIENTS_H_
#define LITAGS_ENGINE_IO_JPEG_COEFFICIENTS_H_

// jpeglib.h needs FILE and size_t to be declared before it.
#include <csetjmp>
#include <cstddef>
#include <cstdio>
#include <string_view>

#include <jpeglib.h>

#include "absl/status/status.h"
#include "engine/io/image_io.h"

namespace litags {

// One photo's coefficients, held by libjpeg's own memory. Not thread-safe.
class JpegCoefficients {
 public:
  JpegCoefficients();
  ~JpegCoefficients();
  JpegCoefficients(const JpegCoefficients&) = delete;
  JpegCoefficients& operator=(const JpegCoefficients&) = delete;

  // Reads the whole file, once. `info` is the checked header; libjpeg must find the same size. The
  // end mark may be missing. A scan that ends early or cannot be decoded is an error, where libjpeg
  // (and OpenCV with it) only warns and fills the rest with grey. Errors as in image_io.h.
  absl::Status Read(std::string_view bytes, const ImageInfo& info, std::string_view field);

  // After Read(): 1, 3 or 4 of them, grey, YCbCr, RGB, CMYK or YCCK by color_space().
  int components() const { return cinfo_.num_components; }
  J_COLOR_SPACE color_space() const { return cinfo_.jpeg_color_space; }
  // Adobe's programs store CMYK inverted.
  bool adobe() const { return cinfo_.saw_Adobe_marker; }
  const jpeg_component_info& component(int c) const { return cinfo_.comp_info[c]; }
  int max_h_samp_factor() const { return cinfo_.max_h_samp_factor; }
  int max_v_samp_factor() const { return cinfo_.max_v_samp_factor; }

  // The quantised blocks of a row of blocks, [component.width_in_blocks]; null if libjpeg has none.
  const JBLOCK* BlockRow(int component, int row);

 private:
  enum class Damage { kNone, kTruncated, kCorrupt, kUnsupported };

  // libjpeg's handlers reach this through cinfo->err, its first member.
  struct ErrorState {
    jpeg_error_mgr manager;
    std::jmp_buf escape;
    Damage damage;
    bool ended;  // the data did, without an end mark
    char message[JMSG_LENGTH_MAX];
  };

  bool HasAllScans() const;
  bool ReadAll(std::string_view bytes, const ImageInfo& info);

  static ErrorState* StateOf(j_common_ptr cinfo);
  [[noreturn]] static void Refuse(ErrorState* state, const char* why);
  [[noreturn]] static void OnError(j_common_ptr cinfo);
  static void OnMessage(j_common_ptr cinfo, int level);
  static void OnProgress(j_common_ptr cinfo);

  jpeg_decompress_struct cinfo_ = {};
  jpeg_progress_mgr progress_ = {};
  ErrorState state_ = {};
  jvirt_barray_ptr* arrays_ = nullptr;
};

}  // namespace litags

#endif  // LITAGS_ENGINE_IO_JPEG_COEFFICIENTS_H_
