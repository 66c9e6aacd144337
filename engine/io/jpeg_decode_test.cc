// JPEGs are decoded as their format says, not as libjpeg rounds them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <numbers>
#include <string>
#include <vector>

#include <jpeglib.h>

#include "engine/core/rng.h"
#include "engine/io/image_io.h"
#include "engine/io/test_util.h"
#include "engine/io/testing_jpeg.h"

namespace litags {
namespace {

// libjpeg, which ends the program on errors.
class Decompress {
 public:
  explicit Decompress(const std::string& bytes) {
    cinfo.err = jpeg_std_error(&errors_);
    jpeg_create_decompress(&cinfo);
    jpeg_mem_src(&cinfo, reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size());
    jpeg_read_header(&cinfo, TRUE);
  }
  ~Decompress() { jpeg_destroy_decompress(&cinfo); }

  jpeg_decompress_struct cinfo;

 private:
  jpeg_error_mgr errors_;
};

// One component in codes, chroma about 0.
struct Component {
  int width = 0, height = 0, stride = 0;
  double across = 1, down = 1;  // samples to a pixel
  std::vector<double> codes;

  double At(int pixel_x, int pixel_y) const {
    const double x = std::clamp((pixel_x + 0.5) * across - 0.5, 0.0, width - 1.0);
    const double y = std::clamp((pixel_y + 0.5) * down - 0.5, 0.0, height - 1.0);
    const int x0 = static_cast<int>(x), y0 = static_cast<int>(y);
    const int x1 = std::min(x0 + 1, width - 1), y1 = std::min(y0 + 1, height - 1);
    const auto code = [&](int u, int v) { return codes[size_t(v) * stride + u]; };
    const double top = std::lerp(code(x0, y0), code(x1, y0), x - x0);
    const double bottom = std::lerp(code(x0, y1), code(x1, y1), x - x0);
    return std::lerp(top, bottom, y - y0);
  }
};

// A.3.3 of the standard (ITU-T T.81), term by term.
double InverseDct(const JCOEF* levels, const UINT16* steps, int x, int y) {
  double sum = 0;
  for (int v = 0; v < 8; ++v) {
    for (int u = 0; u < 8; ++u) {
      const double scale = (u == 0 ? std::sqrt(0.5) : 1) * (v == 0 ? std::sqrt(0.5) : 1) / 4;
      sum += scale * levels[8 * v + u] * steps[8 * v + u] *
             std::cos((2 * x + 1) * u * std::numbers::pi / 16) *
             std::cos((2 * y + 1) * v * std::numbers::pi / 16);
    }
  }
  return sum;
}

Component ReadComponent(jpeg_decompress_struct* cinfo, jvirt_barray_ptr array, int c) {
  const jpeg_component_info& info = cinfo->comp_info[c];
  Component out;
  out.across = double(info.h_samp_factor) / cinfo->max_h_samp_factor;
  out.down = double(info.v_samp_factor) / cinfo->max_v_samp_factor;
  out.width = static_cast<int>(std::ceil(cinfo->image_width * out.across));
  out.height = static_cast<int>(std::ceil(cinfo->image_height * out.down));
  out.stride = (out.width + 7) / 8 * 8;
  const int rows = (out.height + 7) / 8;
  out.codes.resize(size_t(out.stride) * 8 * rows);
  for (int row = 0; row < rows; ++row) {
    const JBLOCKARRAY blocks =
        cinfo->mem->access_virt_barray(reinterpret_cast<j_common_ptr>(cinfo), array, row, 1, FALSE);
    for (int y = 0; y < 8; ++y) {
      for (int x = 0; x < out.stride; ++x) {
        out.codes[size_t(8 * row + y) * out.stride + x] =
            InverseDct(blocks[0][x / 8], info.quant_table->quantval, x % 8, y);
      }
    }
  }
  return out;
}

// [H, W, 3], codes of 255.
std::vector<double> Reference(const std::string& bytes) {
  Decompress jpeg(bytes);
  jpeg_decompress_struct* cinfo = &jpeg.cinfo;
  jvirt_barray_ptr* arrays = jpeg_read_coefficients(cinfo);
  std::vector<Component> components;
  for (int c = 0; c < cinfo->num_components; ++c) {
    components.push_back(ReadComponent(cinfo, arrays[c], c));
  }
  std::vector<double> rgb;
  for (int y = 0; y < int(cinfo->image_height); ++y) {
    for (int x = 0; x < int(cinfo->image_width); ++x) {
      const double luma = components[0].At(x, y) + 128;
      double blue = luma, red = luma;
      if (components.size() == 3) {
        blue += 1.772 * components[1].At(x, y);
        red += 1.402 * components[2].At(x, y);
      }
      rgb.insert(rgb.end(), {red, (luma - 0.299 * red - 0.114 * blue) / 0.587, blue});
    }
  }
  jpeg_finish_decompress(cinfo);
  return rgb;
}

ImageU8 ByLibjpeg(const std::string& bytes) {
  Decompress jpeg(bytes);
  jpeg.cinfo.out_color_space = JCS_RGB;
  jpeg_start_decompress(&jpeg.cinfo);
  ImageU8 image(jpeg.cinfo.output_width, jpeg.cinfo.output_height);
  while (jpeg.cinfo.output_scanline < jpeg.cinfo.output_height) {
    JSAMPROW row = image.pixel(0, jpeg.cinfo.output_scanline);
    jpeg_read_scanlines(&jpeg.cinfo, &row, 1);
  }
  jpeg_finish_decompress(&jpeg.cinfo);
  return image;
}

void ExpectReference(const std::string& jpeg) {
  const auto photo = DecodePhoto(jpeg, "images[a.jpg]");
  ASSERT_TRUE(photo.ok()) << photo.status();
  const std::vector<double> want = Reference(jpeg);
  ASSERT_EQ(photo->data.size(), want.size());
  for (size_t i = 0; i < want.size(); ++i) {
    // Half a sample of luma, of chroma and of the colour: 0.5 (1 + 1.772 + 1).
    ASSERT_NEAR(photo->data[i], std::clamp(want[i] / 255 * kPhotoWhite, -32768.0, 32767.0), 1.9)
        << "pixel " << i / 3 % photo->width << ", " << i / 3 / photo->width;
  }
}

TEST(DecodeJpeg, IsTheStandardsForEveryLayoutAndSize) {
  const JpegLayout layouts[] = {{}, {2, 2}, {2, 1}, {1, 2}, {.grey = true}};
  for (JpegLayout layout : layouts) {
    for (const bool progressive : {false, true}) {
      layout.progressive = progressive;
      for (const auto& [width, height] : {std::pair{17, 13}, {32, 16}, {1, 1}, {33, 9}}) {
        SCOPED_TRACE(testing::Message() << layout.across << layout.down << layout.grey
                                        << progressive << " " << width << "x" << height);
        ExpectReference(EncodeTestJpeg(TestImage(width, height), layout));
      }
    }
  }
}

TEST(DecodeJpeg, CoarseStepsAndHighContrastAreNoMoreThanTheyAre) {
  ImageU8 squares(24, 24);
  for (size_t i = 0; i < squares.data.size(); ++i) {
    squares.data[i] = (i / 3 % 24 / 3 + i / 72 / 3) % 2 ? 255 : 0;
  }
  for (const int quality : {1, 30, 100}) {
    ExpectReference(EncodeTestJpeg(squares, JpegLayout{.quality = quality}));
  }
}

TEST(DecodeJpeg, RoundedItIsNearlyWhatLibjpegGives) {
  // Away from black and white, at which libjpeg cuts luma and chroma off.
  ImageU8 image = TestImage(40, 33);
  for (uint8_t& code : image.data) code = static_cast<uint8_t>(90 + code / 4);
  const std::string jpeg = EncodeTestJpeg(image, JpegLayout());
  const ImageU8 have = DecodeImage(jpeg, "f").value(), want = ByLibjpeg(jpeg);
  double sum = 0;
  for (size_t i = 0; i < want.data.size(); ++i) {
    ASSERT_NEAR(have.data[i], want.data[i], 2) << i;
    sum += std::abs(have.data[i] - want.data[i]);
  }
  EXPECT_LT(sum / want.data.size(), 0.5);
}

// Greys of 0.2 to 2.8 codes, one for each block, of which bytes tell the mean only.
TEST(DecodeJpeg, InTheDarkItHoldsMoreThanBytes) {
  constexpr int kBlocks = 16;
  ImageU8 image(8 * kBlocks, 8 * kBlocks);
  const CounterRng rng(6, 0);
  const auto truth = [](int block) { return 0.2 + 2.6 * block / (kBlocks * kBlocks); };
  const auto block_of = [](size_t i) {
    const int x = static_cast<int>(i % (8 * kBlocks)), y = static_cast<int>(i / (8 * kBlocks));
    return y / 8 * kBlocks + x / 8;
  };
  for (size_t i = 0; i < image.pixels(); ++i) {
    const double dithered = truth(block_of(i)) + rng.Uniform(i);
    std::fill_n(&image.data[3 * i], 3, static_cast<uint8_t>(dithered));
  }
  const std::string jpeg = EncodeTestJpeg(image, {.quality = 92});
  // Root mean square of the blocks' errors, codes.
  const auto error = [&](const Photo& photo) {
    std::vector<double> means(kBlocks * kBlocks);
    for (size_t i = 0; i < photo.pixels(); ++i) {
      means[block_of(i)] += photo.data[3 * i + 1] / kPhotoCode / 64;
    }
    double squares = 0;
    for (int b = 0; b < kBlocks * kBlocks; ++b) squares += std::pow(means[b] - truth(b), 2);
    return std::sqrt(squares / means.size());
  };
  const double precise = error(DecodePhoto(jpeg, "f").value());
  const double bytes = error(PhotoFromU8(ByLibjpeg(jpeg)));
  EXPECT_LT(precise, 0.13);
  EXPECT_LT(precise, 0.6 * bytes);
}

TEST(DecodeJpeg, WhatLiesBelowBlackIsKept) {
  // An edge that rings.
  ImageU8 edge(16, 16);
  for (size_t i = 0; i < edge.data.size(); ++i) edge.data[i] = i / 3 % 16 < 5 ? 0 : 40;
  const Photo photo = DecodePhoto(EncodeTestJpeg(edge, JpegLayout{.quality = 50}), "f").value();
  EXPECT_LT(*std::min_element(photo.data.begin(), photo.data.end()), -kPhotoCode);
}

}  // namespace
}  // namespace litags
