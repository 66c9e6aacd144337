#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include "engine/io/color_space.h"
#include "engine/io/image_header.h"
#include "engine/io/io_error.h"
#include "engine/io/jpeg_coefficients.h"
#include "engine/io/photo_format.h"
#include "engine/io/ycbcr.h"

namespace litags {
namespace {

constexpr int kSide = DCTSIZE;      // of a block, 8
constexpr float kLevelShift = 128;  // codes; samples are stored less this

using Block = std::array<float, DCTSIZE2>;

// Orthonormal DCT-II: basis[u][x] = c(u) cos((2x + 1) u pi / 16) (ITU-T T.81, A.3.3).
const std::array<std::array<float, kSide>, kSide>& Basis() {
  static const auto basis = [] {
    std::array<std::array<float, kSide>, kSide> b;
    for (int u = 0; u < kSide; ++u) {
      for (int x = 0; x < kSide; ++x) {
        const double norm = u == 0 ? std::sqrt(0.125) : 0.5;
        b[u][x] = static_cast<float>(norm * std::cos((2 * x + 1) * u * std::numbers::pi / 16));
      }
    }
    return b;
  }();
  return basis;
}

// 8x8 samples less the level shift, codes of 255.
void InverseDct(const JCOEF* levels, const UINT16* steps, Block* out) {
  const auto& basis = Basis();
  Block columns = {};  // [v][x] after the pass along u
  for (int v = 0; v < kSide; ++v) {
    for (int u = 0; u < kSide; ++u) {
      const int i = v * kSide + u;
      if (levels[i] == 0) continue;
      const float coefficient = static_cast<float>(levels[i]) * steps[i];
      for (int x = 0; x < kSide; ++x) columns[v * kSide + x] += coefficient * basis[u][x];
    }
  }
  *out = {};
  for (int v = 0; v < kSide; ++v) {
    for (int y = 0; y < kSide; ++y) {
      const float weight = basis[v][y];
      for (int x = 0; x < kSide; ++x) (*out)[y * kSide + x] += weight * columns[v * kSide + x];
    }
  }
}

// One component at its own resolution, in samples of Photo; chroma about 0.
struct ComponentPlane {
  int width = 0, height = 0;
  int stride = 0;
  std::vector<int16_t> data;

  ComponentView<int16_t> view() const { return {data.data(), width, height, stride}; }
};

// False if libjpeg has no such blocks.
bool DecodeComponent(JpegCoefficients* jpeg, int c, float shift, ComponentPlane* plane) {
  const jpeg_component_info& info = jpeg->component(c);
  plane->width = info.downsampled_width;
  plane->height = info.downsampled_height;
  plane->stride = info.width_in_blocks * kSide;
  plane->data.resize(size_t(plane->stride) * info.height_in_blocks * kSide);
  Block block;
  for (JDIMENSION by = 0; by < info.height_in_blocks; ++by) {
    const JBLOCK* blocks = jpeg->BlockRow(c, static_cast<int>(by));
    if (blocks == nullptr) return false;
    for (JDIMENSION bx = 0; bx < info.width_in_blocks; ++bx) {
      InverseDct(blocks[bx], info.quant_table->quantval, &block);
      int16_t* to = plane->data.data() + size_t(by) * kSide * plane->stride + bx * kSide;
      for (int y = 0; y < kSide; ++y, to += plane->stride) {
        for (int x = 0; x < kSide; ++x) {
          to[x] = PhotoSample((block[y * kSide + x] + shift) * (1 / 255.0f));
        }
      }
    }
  }
  return true;
}

// JFIF: full-range BT.601.
std::array<float, 3> RgbOf(float luma, float cb, float cr) {
  return {luma + 1.402f * cr, luma - 0.344136f * cb - 0.714136f * cr, luma + 1.772f * cb};
}

// Ink of CMYK, 0..1. YCCK's first three are what YCbCr has for the light that C, M and Y leave.
void ToInk(const std::vector<std::vector<float>>& rows, bool ycck, bool inverted, float* ink) {
  constexpr float kScale = 1.0f / kPhotoWhite;
  for (size_t x = 0; x < rows[0].size(); ++x, ink += 4) {
    for (int c = 0; c < 4; ++c) ink[c] = rows[c][x] * kScale;
    if (ycck) {
      const std::array<float, 3> light = RgbOf(ink[0], ink[1], ink[2]);
      for (int c = 0; c < 3; ++c) ink[c] = 1 - light[c];
    }
    for (int c = 0; c < 4; ++c) ink[c] = std::clamp(inverted ? 1 - ink[c] : ink[c], 0.0f, 1.0f);
  }
}

void ConvertRow(const std::vector<std::vector<float>>& rows, int16_t* out) {
  const float *luma = rows[0].data(), *cb = rows[1].data(), *cr = rows[2].data();
  for (size_t x = 0; x < rows[0].size(); ++x) {
    const auto [red, green, blue] = RgbOf(luma[x], cb[x], cr[x]);
    out[3 * x] = NearestSample(red);
    out[3 * x + 1] = NearestSample(green);
    out[3 * x + 2] = NearestSample(blue);
  }
}

void CopyRgb(const std::vector<std::vector<float>>& rows, int16_t* out) {
  for (size_t x = 0; x < rows[0].size(); ++x) {
    for (size_t c = 0; c < 3; ++c)
      out[3 * x + c] = NearestSample(rows[rows.size() == 3 ? c : 0][x]);
  }
}

// All components of a JPEG, row by row at the photo's size.
class ComponentRows {
 public:
  absl::Status Decode(JpegCoefficients* jpeg, bool ycc, const ImageInfo& info,
                      std::string_view field) {
    const int n = jpeg->components();
    planes_.resize(n);
    rows_.assign(n, std::vector<float>(info.width));
    for (int c = 0; c < n; ++c) {
      const bool chroma = ycc && (c == 1 || c == 2);
      if (!DecodeComponent(jpeg, c, chroma ? 0 : kLevelShift, &planes_[c])) {
        return InvalidField("IMAGE_CORRUPT", field, "the JPEG lacks blocks; send the file again");
      }
      const jpeg_component_info& component = jpeg->component(c);
      const ComponentView<int16_t> view = planes_[c].view();
      upsamplers_.emplace_back(view,
                               TapsOf(info.width, view.width,
                                      double(component.h_samp_factor) / jpeg->max_h_samp_factor()),
                               TapsOf(info.height, view.height,
                                      double(component.v_samp_factor) / jpeg->max_v_samp_factor()));
    }
    return absl::OkStatus();
  }

  const std::vector<std::vector<float>>& Row(int y) {
    for (size_t c = 0; c < rows_.size(); ++c) upsamplers_[c].Row(y, rows_[c].data());
    return rows_;
  }

 private:
  std::vector<ComponentPlane> planes_;
  std::vector<Upsampler<int16_t>> upsamplers_;
  std::vector<std::vector<float>> rows_;
};

absl::StatusOr<Photo> DecodeCmyk(JpegCoefficients* jpeg, std::string_view icc,
                                 const ImageInfo& info, std::string_view field) {
  const std::optional<ColorSpace> space = ColorSpace::FromIcc(icc, 4);
  if (!space.has_value()) {
    return InvalidField("IMAGE_UNSUPPORTED", field,
                        "a CMYK JPEG without a usable colour profile; convert it to RGB");
  }
  const bool ycck = jpeg->color_space() == JCS_YCCK;
  ComponentRows rows;
  LITAGS_RETURN_IF_ERROR(rows.Decode(jpeg, ycck, info, field));
  Photo photo(info.width, info.height);
  std::vector<float> ink(size_t{4} * info.width);
  for (int y = 0; y < info.height; ++y) {
    ToInk(rows.Row(y), ycck, jpeg->adobe(), ink.data());
    space->Convert(ink.data(), info.width, photo.pixel(0, y));
  }
  return photo;
}

absl::StatusOr<Photo> DecodeJpeg(std::string_view bytes, const ImageInfo& info,
                                 std::string_view field) {
  JpegCoefficients jpeg;
  LITAGS_RETURN_IF_ERROR(jpeg.Read(bytes, info, field));
  const std::string icc = JpegProfile(bytes);
  const int n = jpeg.components();
  if (n == 4) return DecodeCmyk(&jpeg, icc, info, field);
  const bool ycc = n == 3 && jpeg.color_space() == JCS_YCbCr;
  ComponentRows rows;
  LITAGS_RETURN_IF_ERROR(rows.Decode(&jpeg, ycc, info, field));
  Photo photo(info.width, info.height);
  for (int y = 0; y < info.height; ++y) {
    (ycc ? ConvertRow : CopyRgb)(rows.Row(y), photo.pixel(0, y));
  }
  if (!icc.empty()) {
    ColorSpace::FromIccOrSrgb(icc, n).Convert(&photo);
  } else if (IsAdobeRgbByExif(bytes)) {
    ColorSpace::AdobeRgb().Convert(&photo);
  }
  return photo;
}

}  // namespace

// From the coefficients: dequantised, inverse DCT in floating point, chroma interpolated linearly
// between its (centred) samples, YCbCr to RGB as in JFIF. Nothing is rounded to 8 bits or clipped
// at black, as libjpeg's own output is: a dark JPEG holds more than 8 bits.
const PhotoFormat kJpegFormat = {ImageFormat::kJpeg, "JPEG", IsJpeg, ParseJpegHeader, DecodeJpeg};

}  // namespace litags
