#include "engine/io/testing_jpeg.h"

#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <vector>

#include <jpeglib.h>

namespace litags {
namespace {

// DC of all components together, then every AC coefficient of each on its own: 190 scans.
std::vector<jpeg_scan_info> ManyScans() {
  std::vector<jpeg_scan_info> scans = {{3, {0, 1, 2, 0}, 0, 0, 0, 0}};
  for (int component = 0; component < 3; ++component) {
    for (int k = 1; k < DCTSIZE2; ++k) scans.push_back({1, {component, 0, 0, 0}, k, k, 0, 0});
  }
  return scans;
}

std::vector<jpeg_scan_info> ScanEach() {
  std::vector<jpeg_scan_info> scans;
  for (int c = 0; c < 3; ++c) scans.push_back({1, {c, 0, 0, 0}, 0, DCTSIZE2 - 1, 0, 0});
  return scans;
}

// `configure` is called with libjpeg's defaults set. Rows are `image`'s, or 128 for CMYK.
template <class Configure>
std::string Encode(const ImageU8& image, int components, J_COLOR_SPACE space,
                   const Configure& configure) {
  jpeg_compress_struct cinfo;
  jpeg_error_mgr errors;
  cinfo.err = jpeg_std_error(&errors);
  jpeg_create_compress(&cinfo);
  unsigned char* out = nullptr;
  unsigned long size = 0;
  jpeg_mem_dest(&cinfo, &out, &size);
  cinfo.image_width = image.width;
  cinfo.image_height = image.height;
  cinfo.input_components = components;
  cinfo.in_color_space = space;
  jpeg_set_defaults(&cinfo);
  configure(&cinfo);
  jpeg_start_compress(&cinfo, TRUE);
  std::vector<JSAMPLE> row(size_t(components) * image.width, 128);
  while (cinfo.next_scanline < cinfo.image_height) {
    const uint8_t* from = image.pixel(0, cinfo.next_scanline);
    for (size_t i = 0; i < row.size() && components <= 3; ++i) {
      row[i] = from[components == 1 ? 3 * i : i];
    }
    JSAMPROW pointer = row.data();
    jpeg_write_scanlines(&cinfo, &pointer, 1);
  }
  jpeg_finish_compress(&cinfo);
  std::string bytes(reinterpret_cast<char*>(out), size);
  jpeg_destroy_compress(&cinfo);
  std::free(out);
  return bytes;
}

}  // namespace

std::string EncodeTestJpeg(const ImageU8& image, TestJpeg kind) {
  const std::vector<jpeg_scan_info> scans = kind == TestJpeg::kScanEach ? ScanEach() : ManyScans();
  const bool cmyk = kind == TestJpeg::kCmyk;
  return Encode(image, cmyk ? 4 : 3, cmyk ? JCS_CMYK : JCS_RGB, [&](j_compress_ptr cinfo) {
    if (kind == TestJpeg::kProgressive) jpeg_simple_progression(cinfo);
    if (kind == TestJpeg::kManyScans || kind == TestJpeg::kScanEach) {
      cinfo->scan_info = scans.data();
      cinfo->num_scans = static_cast<int>(scans.size());
    }
  });
}

std::string EncodeTestJpeg(const ImageU8& image, const JpegLayout& layout) {
  const J_COLOR_SPACE space = layout.grey ? JCS_GRAYSCALE : JCS_RGB;
  return Encode(image, layout.grey ? 1 : 3, space, [&](j_compress_ptr cinfo) {
    jpeg_set_quality(cinfo, layout.quality, TRUE);
    cinfo->comp_info[0].h_samp_factor = layout.across;
    cinfo->comp_info[0].v_samp_factor = layout.down;
    if (layout.progressive) jpeg_simple_progression(cinfo);
  });
}

}  // namespace litags
