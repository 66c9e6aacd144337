#include "engine/video/frame_picture.h"

extern "C" {
#include <libavutil/common.h>
#include <libavutil/frame.h>
#include <libavutil/pixdesc.h>
}

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "engine/core/shrunk_size.h"
#include "engine/io/ycbcr.h"
#include "engine/video/video_color.h"

namespace litags {
namespace {

const AVPixFmtDescriptor* DescriptorOf(const AVFrame& frame) {
  return av_pix_fmt_desc_get(static_cast<AVPixelFormat>(frame.format));
}

bool IsGrey(const AVPixFmtDescriptor& pixels) { return pixels.nb_components < 3; }

bool IsWide(const AVPixFmtDescriptor& pixels) { return pixels.comp[0].depth > 8; }

// Of plane i, as all formats have them: Y', Cb, Cr or G, B, R.
template <class T>
ComponentView<T> PlaneOf(const AVFrame& frame, int i) {
  const AVPixFmtDescriptor& pixels = *DescriptorOf(frame);
  const int x_shift = i == 0 ? 0 : pixels.log2_chroma_w;
  const int y_shift = i == 0 ? 0 : pixels.log2_chroma_h;
  return {reinterpret_cast<const T*>(frame.data[i]), AV_CEIL_RSHIFT(frame.width, x_shift),
          AV_CEIL_RSHIFT(frame.height, y_shift),
          frame.linesize[i] / static_cast<ptrdiff_t>(sizeof(T))};
}

template <class T>
Upsampler<T> UpsamplerOf(const AVFrame& frame, int i) {
  const ComponentView<T> plane = PlaneOf<T>(frame, i);
  const auto [site_x, site_y] = ChromaSitesOf(frame);
  const auto taps = [](int size, int n, bool shared, ChromaSite site) {
    return TapsOf(size, n, shared ? 0.5 : 1, site);
  };
  const AVPixFmtDescriptor& pixels = *DescriptorOf(frame);
  return Upsampler<T>(plane,
                      taps(frame.width, plane.width, i > 0 && pixels.log2_chroma_w > 0, site_x),
                      taps(frame.height, plane.height, i > 0 && pixels.log2_chroma_h > 0, site_y));
}

template <class T>
Photo ReadPicture(const AVFrame& frame) {
  const bool grey = IsGrey(*DescriptorOf(frame));
  const YCbCrKind kind = KindOf(frame);
  const YCbCrToRgb conversion(kind);
  std::vector<Upsampler<T>> planes;
  for (int i = 0; i < (grey ? 1 : 3); ++i) planes.push_back(UpsamplerOf<T>(frame, i));
  const size_t width = frame.width;
  std::vector<float> rows[3], rgb(3 * width);
  for (auto& row : rows) row.assign(width, static_cast<float>(1 << (kind.bits - 1)));
  Photo photo(frame.width, frame.height);
  for (int y = 0; y < frame.height; ++y) {
    for (size_t i = 0; i < planes.size(); ++i) planes[i].Row(y, rows[i].data());
    conversion.Convert(rows[0].data(), rows[1].data(), rows[2].data(), width, rgb.data());
    std::transform(rgb.begin(), rgb.end(), photo.pixel(0, y), PhotoSample);
  }
  ToSrgb(frame, &photo);
  return photo;
}

}  // namespace

bool HasReadablePixels(const AVFrame& frame) {
  const AVPixFmtDescriptor* pixels = DescriptorOf(frame);
  constexpr uint64_t kOthers = AV_PIX_FMT_FLAG_BE | AV_PIX_FMT_FLAG_PAL |
                               AV_PIX_FMT_FLAG_BITSTREAM | AV_PIX_FMT_FLAG_HWACCEL |
                               AV_PIX_FMT_FLAG_BAYER | AV_PIX_FMT_FLAG_FLOAT;
  if (pixels == nullptr || (pixels->flags & kOthers) != 0 || pixels->log2_chroma_w > 1 ||
      pixels->log2_chroma_h > 1) {
    return false;
  }
  for (int c = 0; c < (IsGrey(*pixels) ? 1 : 3); ++c) {
    const AVComponentDescriptor& component = pixels->comp[c];
    if (component.step != (IsWide(*pixels) ? 2 : 1) || component.offset != 0 ||
        component.shift != 0 || component.depth < 8 || frame.data[component.plane] == nullptr ||
        frame.linesize[component.plane] <= 0) {
      return false;
    }
  }
  return true;
}

Planes LumaOf(const AVFrame& frame, int side) {
  const YCbCrKind kind = KindOf(frame);
  const double unit = std::exp2(16 - kind.bits);  // of 16 bits, which shrinking rounds to
  const cv::Mat codes(frame.height, frame.width, kind.bits > 8 ? CV_16U : CV_8U, frame.data[0],
                      static_cast<size_t>(frame.linesize[0]));
  const auto [width, height] = ShrunkSize(frame.width, frame.height, side);
  const cv::Size size(width, height);
  cv::Mat fine, shrunk;
  codes.convertTo(fine, CV_16U, unit);
  cv::resize(fine, shrunk, size, 0, 0, cv::INTER_AREA);
  const auto [black, white] = LumaRangeOf(kind);
  Planes luma(1, size.height, size.width);
  cv::Mat out(size, CV_32F, luma.data.data());
  shrunk.convertTo(out, CV_32F, 1 / (unit * (white - black)), -black / (white - black));
  return luma;
}

Photo PictureOf(const AVFrame& frame) {
  return IsWide(*DescriptorOf(frame)) ? ReadPicture<uint16_t>(frame) : ReadPicture<uint8_t>(frame);
}

}  // namespace litags
