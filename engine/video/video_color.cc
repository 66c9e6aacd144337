#include "engine/video/video_color.h"

extern "C" {
#include <libavutil/frame.h>
#include <libavutil/pixdesc.h>
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
  if (code < 0) return -LinearFromHlg(-code);
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

// Linear light of every sample of HLG, from -32768 on.
const std::vector<float>& HlgTable() {
  static const std::vector<float> table = [] {
    std::vector<float> values(65536);
    for (int i = 0; i < 65536; ++i) {
      values[i] = static_cast<float>(LinearFromHlg((i - 32768.0) / kPhotoWhite));
    }
    return values;
  }();
  return table;
}

}  // namespace

YCbCrKind KindOf(const AVFrame& frame) {
  const AVPixFmtDescriptor& pixels = *av_pix_fmt_desc_get(static_cast<AVPixelFormat>(frame.format));
  const int range = NumberOf(frame.color_range);
  YCbCrKind kind;
  kind.bits = pixels.comp[0].depth;
  kind.primaries = NumberOf(frame.color_primaries);
  if ((pixels.flags & AV_PIX_FMT_FLAG_RGB) != 0) {
    kind.matrix = AVCOL_SPC_RGB;
    kind.full_range = range != AVCOL_RANGE_MPEG;
    return kind;
  }
  kind.matrix = NumberOf(frame.colorspace);
  if (kind.matrix == AVCOL_SPC_RGB || kind.matrix == AVCOL_SPC_UNSPECIFIED) {
    kind.matrix = frame.height >= kHdLines ? AVCOL_SPC_BT709 : AVCOL_SPC_SMPTE170M;
  }
  // Any makes R = G = B of grey.
  if (pixels.nb_components < 3) kind.matrix = AVCOL_SPC_SMPTE170M;
  kind.full_range = range == AVCOL_RANGE_JPEG || frame.format == AV_PIX_FMT_YUVJ420P ||
                    frame.format == AV_PIX_FMT_YUVJ422P || frame.format == AV_PIX_FMT_YUVJ440P ||
                    frame.format == AV_PIX_FMT_YUVJ444P;
  return kind;
}

std::pair<ChromaSite, ChromaSite> ChromaSitesOf(const AVFrame& frame) {
  const int at = NumberOf(frame.chroma_location);
  const bool centre_x = at == AVCHROMA_LOC_CENTER || at == AVCHROMA_LOC_TOP;
  const bool first_y = at == AVCHROMA_LOC_TOPLEFT || at == AVCHROMA_LOC_TOP;
  return {centre_x ? ChromaSite::kCentre : ChromaSite::kFirst,
          first_y ? ChromaSite::kFirst : ChromaSite::kCentre};
}

bool HasPqLight(const AVFrame& frame) { return NumberOf(frame.color_trc) == AVCOL_TRC_SMPTE2084; }

void ToSrgb(const AVFrame& frame, Photo* photo) {
  const bool hlg = NumberOf(frame.color_trc) == AVCOL_TRC_ARIB_STD_B67;
  const int primaries = NumberOf(frame.color_primaries);
  constexpr Matrix kSame = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
  const Matrix& m = primaries == AVCOL_PRI_BT2020     ? kFromBt2020
                    : primaries == AVCOL_PRI_SMPTE432 ? kFromP3
                                                      : kSame;
  if (!hlg && &m == &kSame) return;
  const SampleTable& sample = SampleTable::Get();
  for (size_t i = 0; i < photo->data.size(); i += 3) {
    double light[3];
    for (size_t c = 0; c < 3; ++c) {
      const int16_t code = photo->data[i + c];
      light[c] = hlg ? HlgTable()[code + 32768] : LinearTable::Get()(code);
    }
    for (size_t c = 0; c < 3; ++c) {
      photo->data[i + c] =
          sample(static_cast<float>(m[c][0] * light[0] + m[c][1] * light[1] + m[c][2] * light[2]));
    }
  }
}

}  // namespace litags
