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

}  // namespace

std::string EncodeTestJpeg(const ImageU8& image, TestJpeg kind) {
  jpeg_compress_struct cinfo;
  jpeg_error_mgr errors;
  cinfo.err = jpeg_std_error(&errors);
  jpeg_create_compress(&cinfo);
  unsigned char* out = nullptr;
  unsigned long size = 0;
  jpeg_mem_dest(&cinfo, &out, &size);
  const bool cmyk = kind == TestJpeg::kCmyk;
  cinfo.image_width = image.width;
  cinfo.image_height = image.height;
  cinfo.input_components = cmyk ? 4 : 3;
  cinfo.in_color_space = cmyk ? JCS_CMYK : JCS_RGB;
  jpeg_set_defaults(&cinfo);
  const std::vector<jpeg_scan_info> scans = ManyScans();
  if (kind == TestJpeg::kProgressive) jpeg_simple_progression(&cinfo);
  if (kind == TestJpeg::kManyScans) {
    cinfo.scan_info = scans.data();
    cinfo.num_scans = static_cast<int>(scans.size());
  }
  jpeg_start_compress(&cinfo, TRUE);
  std::vector<JSAMPLE> row(size_t(cinfo.input_components) * image.width, 128);
  while (cinfo.next_scanline < cinfo.image_height) {
    if (!cmyk)
      row.assign(image.pixel(0, cinfo.next_scanline),
                 image.pixel(0, cinfo.next_scanline) + row.size());
    JSAMPROW pointer = row.data();
    jpeg_write_scanlines(&cinfo, &pointer, 1);
  }
  jpeg_finish_compress(&cinfo);
  std::string bytes(reinterpret_cast<char*>(out), size);
  jpeg_destroy_compress(&cinfo);
  std::free(out);
  return bytes;
}

}  // namespace litags
