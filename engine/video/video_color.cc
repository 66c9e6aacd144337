#include "engine/video/video_color.h"

extern "C" {
#include <libavutil/frame.h>
#include <libswscale/swscale.h>
}

#include <array>
#include <cmath>
#include <cstring>
#include <vector>

#include "engine/core/color.h"

namespace litags {
namespace {

using Matrix = std::array<std::array<double, 3>, 3>;

constexpr int kHdLines = 720;

// Linear light of sRGB's primaries, from that of others with the same white (D65).
constexpr Matrix kFromBt2020 = {{{1.660491, -0.587641, -0.072850},
                                 {-0.124550, 1.132900, -0.008349},
                                 {-0.018151, -0.100579, 1.118730}}};
constexpr Matrix kFromP3 = {
    {{1.224940, -0.224940, 0.0}, {-0.042057, 1.042057, 0.0}, {-0.019638, -0.078636, 1.098274}}};

// Light of the scene, 1: the brightest that HLG has. ITU-R BT.2100, inverse OETF.
double LinearFromHlg(double code) {
  constexpr double kA = 0.17883277, kB = 0.28466892, kC = 0.55991073;
  return code <= 0.5 ? code * code / 3 : (std::exp((code - kC) / kA) + kB) / 12;
}

// A field of FFmpeg's that has what the file says. To read it as its enum is undefined where that
// has no such value.
template <class Enum>
int NumberOf(const Enum& field) {
  int number;
  static_assert(sizeof(field) == sizeof(number));
  std::memcpy(&number, &field, sizeof(number));
  return number;
}

// Linear light of every code of 16 bits.
std::vector<float> Tabulate(double (*linear)(double code)) {
  std::vector<float> table(65536);
  for (size_t i = 0; i < table.size(); ++i) {
    table[i] = static_cast<float>(linear(double(i) / 65535));
  }
  return table;
}

}  // namespace

int MatrixOf(const AVFrame& frame) {
  switch (NumberOf(frame.colorspace)) {
    case AVCOL_SPC_BT709:
      return SWS_CS_ITU709;
    case AVCOL_SPC_BT2020_NCL:
    case AVCOL_SPC_BT2020_CL:
      return SWS_CS_BT2020;
    case AVCOL_SPC_BT470BG:
    case AVCOL_SPC_SMPTE170M:
      return SWS_CS_ITU601;
    default:
      return frame.height >= kHdLines ? SWS_CS_ITU709 : SWS_CS_ITU601;
  }
}

bool HasFullRange(const AVFrame& frame) {
  return NumberOf(frame.color_range) == AVCOL_RANGE_JPEG || frame.format == AV_PIX_FMT_YUVJ420P ||
         frame.format == AV_PIX_FMT_YUVJ422P || frame.format == AV_PIX_FMT_YUVJ444P;
}

bool HasPqLight(const AVFrame& frame) { return NumberOf(frame.color_trc) == AVCOL_TRC_SMPTE2084; }

void ToSrgb(std::span<const uint16_t> codes, const AVFrame& frame, Photo* photo) {
  constexpr float kUnit = 1.0f / 65535;
  const bool hlg = NumberOf(frame.color_trc) == AVCOL_TRC_ARIB_STD_B67;
  const int primaries = NumberOf(frame.color_primaries);
  const Matrix* matrix = primaries == AVCOL_PRI_BT2020     ? &kFromBt2020
                         : primaries == AVCOL_PRI_SMPTE432 ? &kFromP3
                                                           : nullptr;
  if (!hlg && matrix == nullptr) {
    for (size_t i = 0; i < codes.size(); ++i) {
      photo->data[i] = PhotoSample(static_cast<float>(codes[i]) * kUnit);
    }
    return;
  }
  static const std::vector<float> from_hlg = Tabulate(LinearFromHlg),
                                  from_srgb = Tabulate(LinearFromSrgb);
  const std::vector<float>& linear = hlg ? from_hlg : from_srgb;
  constexpr Matrix kSame = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
  const Matrix& m = matrix == nullptr ? kSame : *matrix;
  const SampleTable& sample = SampleTable::Get();
  for (size_t i = 0; i < codes.size(); i += 3) {
    const double light[] = {linear[codes[i]], linear[codes[i + 1]], linear[codes[i + 2]]};
    for (size_t c = 0; c < 3; ++c) {
      photo->data[i + c] =
          sample(static_cast<float>(m[c][0] * light[0] + m[c][1] * light[1] + m[c][2] * light[2]));
    }
  }
}

}  // namespace litags
