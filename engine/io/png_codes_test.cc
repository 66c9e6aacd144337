#include "engine/io/png_codes.h"

#include <gtest/gtest.h>
#include <png.h>

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "engine/core/error.h"
#include "engine/io/alpha_mask.h"

namespace litags {
namespace {

constexpr int kWidth = 13, kHeight = 9;

struct Codes {
  PngShape shape;
  std::vector<uint16_t> data;
};

absl::StatusOr<Codes> Read(std::string_view png, PngChannels channels) {
  Codes read;
  const auto take = [&](const PngShape& shape, int y, const uint16_t* codes) {
    EXPECT_EQ(read.data.size(), size_t(y) * shape.width * shape.channels);
    read.shape = shape;
    read.data.insert(read.data.end(), codes, codes + size_t(shape.width) * shape.channels);
  };
  LITAGS_RETURN_IF_ERROR(ReadPngCodes(png, channels, "f", take));
  return read;
}

cv::Mat Noise(int type) {
  cv::Mat mat(kHeight, kWidth, type);
  cv::RNG(7).fill(mat, cv::RNG::UNIFORM, 0, CV_MAT_DEPTH(type) == CV_16U ? 65536 : 256);
  return mat;
}

// In the order of PNG, as 16 bits.
std::vector<uint16_t> InOrder(cv::Mat mat) {
  if (mat.channels() == 3) cv::cvtColor(mat, mat, cv::COLOR_BGR2RGB);
  if (mat.channels() == 4) cv::cvtColor(mat, mat, cv::COLOR_BGRA2RGBA);
  mat.convertTo(mat, CV_16U);
  return {mat.ptr<uint16_t>(), mat.ptr<uint16_t>() + mat.total() * mat.channels()};
}

std::string Text(const std::vector<uint8_t>& bytes) { return {bytes.begin(), bytes.end()}; }

// What libpng writes by itself: a palette of 4 entries, the first one transparent.
std::string Palette(int interlace) {
  std::string out;
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
  png_infop info = png_create_info_struct(png);
  png_set_write_fn(
      png, &out,
      [](png_structp p, png_bytep from, size_t size) {
        static_cast<std::string*>(png_get_io_ptr(p))->append(reinterpret_cast<char*>(from), size);
      },
      nullptr);
  png_set_IHDR(png, info, kWidth, kHeight, 8, PNG_COLOR_TYPE_PALETTE, interlace, 0, 0);
  const png_color colors[] = {{1, 2, 3}, {40, 50, 60}, {70, 80, 90}, {255, 0, 128}};
  const png_byte alpha[] = {0};
  png_set_PLTE(png, info, colors, 4);
  png_set_tRNS(png, info, alpha, 1, nullptr);
  png_write_info(png, info);
  std::vector<uint8_t> codes(kWidth * kHeight);
  std::vector<png_bytep> rows;
  for (size_t i = 0; i < codes.size(); ++i) codes[i] = (i * i / 3) % 4;
  for (int y = 0; y < kHeight; ++y) rows.push_back(&codes[y * kWidth]);
  png_write_image(png, rows.data());
  png_write_end(png, info);
  png_destroy_write_struct(&png, &info);
  return out;
}

TEST(PngCodes, ReadWhatOpenCvWrites) {
  for (const int type : {CV_8UC1, CV_8UC3, CV_8UC4, CV_16UC1, CV_16UC3, CV_16UC4}) {
    SCOPED_TRACE(cv::typeToString(type));
    const cv::Mat mat = Noise(type);
    std::vector<uint8_t> png;
    ASSERT_TRUE(cv::imencode(".png", mat, png));
    const auto all = Read(Text(png), PngChannels::kAll);
    ASSERT_TRUE(all.ok()) << all.status();
    EXPECT_EQ(all->shape.channels, mat.channels());
    EXPECT_EQ(all->shape.white, mat.depth() == CV_16U ? 65535 : 255);
    EXPECT_EQ(all->data, InOrder(mat));

    const auto color = Read(Text(png), PngChannels::kColor);
    ASSERT_TRUE(color.ok()) << color.status();
    EXPECT_EQ(color->shape.channels, 3);
    EXPECT_EQ(color->data, InOrder(cv::imdecode(png, cv::IMREAD_COLOR | cv::IMREAD_ANYDEPTH)));
  }
}

TEST(PngCodes, OpenCvReadsWhatIsWritten) {
  for (const int channels : {1, 3, 4}) {
    SCOPED_TRACE(channels);
    const std::vector<uint16_t> deep = InOrder(Noise(CV_MAKETYPE(CV_16U, channels)));
    for (const PngSpeed speed : {PngSpeed::kPicture, PngSpeed::kPhoto}) {
      const auto png = EncodePngCodes(deep.data(), kWidth, kHeight, channels, speed);
      ASSERT_TRUE(png.ok()) << png.status();
      EXPECT_EQ(
          InOrder(cv::imdecode(std::vector<char>(png->begin(), png->end()), cv::IMREAD_UNCHANGED)),
          deep);
    }
    const std::vector<uint16_t> codes = InOrder(Noise(CV_MAKETYPE(CV_8U, channels)));
    const std::vector<uint8_t> bytes(codes.begin(), codes.end());
    const auto png = EncodePngCodes(bytes.data(), kWidth, kHeight, channels);
    ASSERT_TRUE(png.ok()) << png.status();
    EXPECT_EQ(
        InOrder(cv::imdecode(std::vector<char>(png->begin(), png->end()), cv::IMREAD_UNCHANGED)),
        codes);
  }
}

TEST(PngCodes, PalettesAndInterlacedPicturesAreReadWithTheirTransparency) {
  for (const int interlace : {PNG_INTERLACE_NONE, PNG_INTERLACE_ADAM7}) {
    SCOPED_TRACE(interlace);
    const std::string png = Palette(interlace);
    const auto all = Read(png, PngChannels::kAll);
    ASSERT_TRUE(all.ok()) << all.status();
    ASSERT_EQ(all->shape.channels, 4);
    const auto color = Read(png, PngChannels::kColor);
    ASSERT_TRUE(color.ok()) << color.status();
    const cv::Mat expected = cv::imdecode(std::vector<char>(png.begin(), png.end()),
                                          cv::IMREAD_COLOR | cv::IMREAD_ANYDEPTH);
    EXPECT_EQ(color->data, InOrder(expected));
    const PlaneU8 mask = AlphaMask(png, 1);
    ASSERT_EQ(mask.width, kWidth);
    for (size_t i = 0; i < mask.data.size(); ++i) {
      EXPECT_EQ(all->data[4 * i + 3], (i * i / 3) % 4 == 0 ? 0 : 255);
      EXPECT_EQ(mask.data[i] != 0, (i * i / 3) % 4 != 0);
    }
  }
}

TEST(PngCodes, DamageIsAnError) {
  const std::string png = Palette(PNG_INTERLACE_NONE);
  std::string flipped = png;
  flipped[flipped.find("IDAT") + 12] ^= 1;
  EXPECT_EQ(GetErrorDetail(Read(flipped, PngChannels::kAll).status())->reason, "IMAGE_CORRUPT");
  EXPECT_EQ(GetErrorDetail(Read(png.substr(0, png.size() - 9), PngChannels::kAll).status())->reason,
            "IMAGE_TRUNCATED");
  // Of two headers, libpng takes no second one.
  std::string two = png;
  two.insert(8, png.substr(8, 25));
  EXPECT_EQ(GetErrorDetail(Read(two, PngChannels::kAll).status())->reason, "IMAGE_CORRUPT");
  EXPECT_EQ(GetErrorDetail(EncodePngCodes(static_cast<const uint8_t*>(nullptr), 0, 4, 3).status())
                ->reason,
            "IMAGE_EMPTY");
}

}  // namespace
}  // namespace litags
