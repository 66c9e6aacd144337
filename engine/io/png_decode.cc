// PNG of 8 and 16 bits, by OpenCV.
#include <zlib.h>

#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <optional>
#include <string>
#include <vector>

#include "engine/io/color_space.h"
#include "engine/io/image_header.h"
#include "engine/io/io_error.h"
#include "engine/io/photo_format.h"

namespace litags {
namespace {

std::string Inflate(std::string_view deflated) {
  std::string out;
  // The size is not said, and most profiles are small. A bomb has more than any may.
  for (size_t size = size_t{64} << 10; size <= kMaxProfileBytes; size *= 2) {
    out.resize(size);
    uLongf written = size;
    const int result = uncompress(reinterpret_cast<Bytef*>(out.data()), &written,
                                  reinterpret_cast<const Bytef*>(deflated.data()), deflated.size());
    if (result == Z_OK) return out.substr(0, written);
    if (result != Z_BUF_ERROR) break;
  }
  return "";
}

ColorSpace ColorSpaceOf(const PngColors& colors) {
  constexpr double kUsual = 1 / 2.2;  // is written for sRGB
  if (!colors.deflated_profile.empty()) {
    const std::string icc = Inflate(colors.deflated_profile);
    const std::optional<ColorSpace> space = ColorSpace::FromIcc(icc, colors.is_grey ? 1 : 3);
    return space.value_or(ColorSpace::Srgb(3));
  }
  const bool said = !colors.is_srgb && colors.gamma > 0.1 && colors.gamma < 10;
  if (!said || std::abs(colors.gamma - kUsual) < 0.02) return ColorSpace::Srgb(3);
  return ColorSpace::Gamma(1 / colors.gamma, 3);
}

// Photo from codes in BGR order, of which `white` is 1.
template <class T>
Photo PhotoFromBgr(const cv::Mat& bgr, float white, const PngColors& colors) {
  const ColorSpace space = ColorSpaceOf(colors);
  const auto least = static_cast<float>(colors.least);
  Photo photo(bgr.cols, bgr.rows);
  const int n = space.channels();
  std::vector<float> codes(size_t(n) * bgr.cols);
  for (int y = 0; y < bgr.rows; ++y) {
    const T* from = bgr.ptr<T>(y);
    for (int x = 0; x < bgr.cols; ++x) {
      for (int c = 0; c < n; ++c)
        codes[n * x + c] = least + (1 - least) * (from[3 * x + 2 - c] / white);
    }
    space.Convert(codes.data(), bgr.cols, photo.pixel(0, y));
  }
  return photo;
}

absl::StatusOr<Photo> DecodePng(std::string_view bytes, const ImageInfo& info,
                                std::string_view field) {
  LITAGS_RETURN_IF_ERROR(CheckPngComplete(bytes, field));
  try {
    const cv::Mat encoded(1, static_cast<int>(bytes.size()), CV_8U,
                          const_cast<char*>(bytes.data()));
    const cv::Mat bgr = cv::imdecode(
        encoded, cv::IMREAD_COLOR | cv::IMREAD_ANYDEPTH | cv::IMREAD_IGNORE_ORIENTATION);
    if (bgr.cols != info.width || bgr.rows != info.height) {
      return InvalidField("IMAGE_CORRUPT", field, "the PNG cannot be decoded; send the file again");
    }
    const PngColors colors = ReadPngColors(bytes);
    return bgr.depth() == CV_16U ? PhotoFromBgr<uint16_t>(bgr, 65535, colors)
                                 : PhotoFromBgr<uint8_t>(bgr, 255, colors);
  } catch (const cv::Exception& e) {
    return InvalidField("IMAGE_CORRUPT", field,
                        absl::StrCat("the PNG cannot be decoded: ", e.what()));
  }
}

}  // namespace

const PhotoFormat kPngFormat = {ImageFormat::kPng, "PNG", IsPng, ParsePngHeader, DecodePng};

}  // namespace litags
