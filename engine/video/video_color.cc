#include "engine/video/video_color.h"

extern "C" {
#include <libavutil/frame.h>
#include <libavutil/pixdesc.h>
}

#include <cstring>

#include "engine/io/color_space.h"

namespace litags {
namespace {

constexpr int kHdLines = 720;

// A field of FFmpeg's that has what the file says. To read it as its enum is undefined where that
// has no such value.
template <class Enum>
int NumberOf(const Enum& field) {
  int number;
  static_assert(sizeof(field) == sizeof(number));
  std::memcpy(&number, &field, sizeof(number));
  return number;
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
  constexpr int kHlg = AVCOL_TRC_ARIB_STD_B67, kSrgb = AVCOL_TRC_IEC61966_2_1;
  const int curve = NumberOf(frame.color_trc) == kHlg ? kHlg : kSrgb;
  ColorSpace::FromCodePoints(NumberOf(frame.color_primaries), curve, "").value().Convert(photo);
}

}  // namespace litags
