#include "engine/io/heif_codecs.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "engine/core/camera.h"

namespace litags {
namespace {

thread_local CodedPictures coded;

constexpr heif_channel kChannels[] = {heif_channel_R, heif_channel_G, heif_channel_B,
                                      heif_channel_Alpha};
constexpr int kMaxBits = 16;
constexpr int kFractionBits = 4;  // of a code of chroma, in pictures of 8 bits

template <class T>
Upsampler<T> UpsamplerOf(const CodedPicture& picture, int channel) {
  const bool chroma = channel > 0, grey = picture.chroma == heif_chroma_monochrome;
  const bool half_x = chroma && !grey && picture.chroma != heif_chroma_444;
  const bool half_y = chroma && picture.chroma == heif_chroma_420;
  const ComponentView<T> view = {reinterpret_cast<const T*>(picture.planes[channel]),
                                 half_x ? (picture.width + 1) / 2 : picture.width,
                                 half_y ? (picture.height + 1) / 2 : picture.height,
                                 picture.strides[channel] / ptrdiff_t{sizeof(T)}};
  return {view, TapsOf(picture.width, view.width, half_x ? 0.5 : 1, picture.site_x),
          TapsOf(picture.height, view.height, half_y ? 0.5 : 1, picture.site_y)};
}

// `rows`: Y, Cb, Cr in codes. Interpolation gives sixteenths of a code at the finest.
void PackRow8(const std::array<std::vector<float>, 3>& rows, const std::array<uint8_t*, 4>& to) {
  constexpr int kOne = 1 << kFractionBits;
  for (size_t x = 0; x < rows[0].size(); ++x) {
    const int cb = static_cast<int>(rows[1][x] * kOne), cr = static_cast<int>(rows[2][x] * kOne);
    to[0][x] = static_cast<uint8_t>(rows[0][x]);
    to[1][x] = static_cast<uint8_t>(cb / kOne);
    to[2][x] = static_cast<uint8_t>(cr / kOne);
    to[3][x] = static_cast<uint8_t>(cb % kOne * kOne + cr % kOne);
  }
}

// A damaged stream may give samples of more bits than it states.
void PackRow16(const std::array<std::vector<float>, 3>& rows, int bits,
               const std::array<uint8_t*, 4>& to) {
  const auto one = static_cast<float>(1 << (kMaxBits - bits));
  for (int c = 0; c < 3; ++c) {
    auto* samples = reinterpret_cast<uint16_t*>(to[c]);
    for (size_t x = 0; x < rows[c].size(); ++x) {
      samples[x] = static_cast<uint16_t>(std::min(rows[c][x] * one, 65535.0f));
    }
  }
}

template <class T>
void PackPlanes(const CodedPicture& picture, std::array<uint8_t*, 4> to,
                const std::array<int, 4>& strides) {
  const int components = picture.chroma == heif_chroma_monochrome ? 1 : 3;
  std::array<std::vector<float>, 3> rows;
  rows.fill(std::vector<float>(picture.width, static_cast<float>(1 << (picture.bits - 1))));
  std::vector<Upsampler<T>> upsamplers;
  for (int c = 0; c < components; ++c) upsamplers.push_back(UpsamplerOf<T>(picture, c));
  for (int y = 0; y < picture.height; ++y) {
    for (int c = 0; c < components; ++c) upsamplers[c].Row(y, rows[c].data());
    sizeof(T) == 1 ? PackRow8(rows, to) : PackRow16(rows, picture.bits, to);
    for (int c = 0; c < 4; ++c) to[c] += strides[c];
  }
}

}  // namespace

CodedPictures TakeCodedPictures() { return std::exchange(coded, {}); }

void UseHeifCodecs() {
  static const bool done = [] {
    heif_init(nullptr);
    heif_register_decoder_plugin(&kHevcCodec);
    heif_register_decoder_plugin(&kAv1Codec);
    return true;
  }();
  (void)done;
}

heif_error CodecError(const char* message) {
  return {heif_error_Decoder_plugin_error, heif_suberror_Unspecified, message};
}

heif_error CodecSizeError() {
  return {heif_error_Memory_allocation_error, heif_suberror_Security_limit_exceeded,
          "its stream states a larger picture"};
}

bool IsCodedSizeTaken(uint64_t width, uint64_t height) {
  // Codecs code whole blocks, of 64 px at most.
  constexpr uint64_t kBlock = 64;
  constexpr uint64_t kMaxSide = kMaxImageSide + kBlock;
  return width <= kMaxSide && height <= kMaxSide &&
         width * height <= uint64_t{kMaxImagePixels} + kBlock * (width + height);
}

heif_error CopyPicture(const CodedPicture& picture, heif_image** out) {
  const bool grey = picture.chroma == heif_chroma_monochrome, deep = picture.bits > 8;
  if (picture.bits < 8 || picture.bits > kMaxBits) {
    return CodecError("its samples have fewer bits than 8, or more than 16");
  }
  heif_image* image = nullptr;
  heif_error error = heif_image_create(picture.width, picture.height, heif_colorspace_RGB,
                                       heif_chroma_444, &image);
  if (error.code != heif_error_Ok) return error;
  std::array<uint8_t*, 4> to = {};
  std::array<int, 4> strides = {};
  for (int c = 0; c < (deep ? 3 : 4); ++c) {
    error = heif_image_add_plane(image, kChannels[c], picture.width, picture.height, picture.bits);
    to[c] = heif_image_get_plane(image, kChannels[c], &strides[c]);
    const bool is_coded = c == 0 || (c < 3 && !grey);
    if (error.code != heif_error_Ok || to[c] == nullptr ||
        (is_coded && picture.planes[c] == nullptr)) {
      heif_image_release(image);
      return CodecError("there is no memory for its picture");
    }
  }
  deep ? PackPlanes<uint16_t>(picture, to, strides) : PackPlanes<uint8_t>(picture, to, strides);
  coded.pixels += uint64_t(picture.width) * picture.height;
  coded.kind = picture.kind;
  coded.grey = grey;
  *out = image;
  return kHeifOk;
}

bool CodedRows::Open(const heif_image* image, int width, int height) {
  width_ = width;
  bits_ = heif_image_get_bits_per_pixel_range(image, kChannels[0]);
  for (int c = 0; c < (bits_ > 8 ? 3 : 4); ++c) {
    int stride = 0;
    planes_[c] = heif_image_get_plane_readonly(image, kChannels[c], &stride);
    strides_[c] = stride;
    if (planes_[c] == nullptr || heif_image_get_width(image, kChannels[c]) != width ||
        heif_image_get_height(image, kChannels[c]) != height ||
        heif_image_get_bits_per_pixel_range(image, kChannels[c]) != bits_) {
      return false;
    }
  }
  return true;
}

void CodedRows::Row(int y, float* luma, float* cb, float* cr) const {
  float* const out[] = {luma, cb, cr};
  const float step = 1.0f / static_cast<float>(1 << (kMaxBits - bits_));
  for (int c = 0; c < 3; ++c) {
    const uint8_t* row = planes_[c] + y * strides_[c];
    for (int x = 0; x < width_; ++x) {
      if (bits_ == 8) {
        out[c][x] = row[x];
      } else {
        out[c][x] = static_cast<float>(row[2 * x] | row[2 * x + 1] << 8) * step;
      }
    }
  }
  if (bits_ > 8) return;
  constexpr int kOne = 1 << kFractionBits;
  const uint8_t* fractions = planes_[3] + y * strides_[3];
  for (int x = 0; x < width_; ++x) {
    cb[x] += static_cast<float>(fractions[x] / kOne) / kOne;
    cr[x] += static_cast<float>(fractions[x] % kOne) / kOne;
  }
}

}  // namespace litags
