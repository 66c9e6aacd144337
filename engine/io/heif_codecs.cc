#include "engine/io/heif_codecs.h"

#include <cstring>
#include <utility>

#include "engine/core/camera.h"

namespace litags {
namespace {

thread_local uint64_t coded_pixels = 0;

}  // namespace

uint64_t TakeCodedPixels() { return std::exchange(coded_pixels, 0); }

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
  constexpr heif_channel kChannels[] = {heif_channel_Y, heif_channel_Cb, heif_channel_Cr};
  const bool grey = picture.chroma == heif_chroma_monochrome;
  heif_image* image = nullptr;
  heif_error error = heif_image_create(picture.width, picture.height,
                                       grey ? heif_colorspace_monochrome : heif_colorspace_YCbCr,
                                       picture.chroma, &image);
  if (error.code != heif_error_Ok) return error;
  for (int c = 0; c < (grey ? 1 : 3); ++c) {
    const int half_x = c > 0 && picture.chroma != heif_chroma_444;
    const int half_y = c > 0 && picture.chroma == heif_chroma_420;
    const int width = (picture.width + half_x) >> half_x,
              height = (picture.height + half_y) >> half_y;
    error = heif_image_add_plane(image, kChannels[c], width, height, picture.bits);
    int stride = 0;
    uint8_t* to = heif_image_get_plane(image, kChannels[c], &stride);
    if (error.code != heif_error_Ok || to == nullptr || picture.planes[c] == nullptr) {
      heif_image_release(image);
      return CodecError("there is no memory for its picture");
    }
    const size_t row = size_t(width) * (picture.bits > 8 ? 2 : 1);
    for (int y = 0; y < height; ++y) {
      std::memcpy(to + ptrdiff_t{y} * stride, picture.planes[c] + y * picture.strides[c], row);
    }
  }
  heif_color_profile_nclx* points = heif_nclx_color_profile_alloc();
  // Numbers that libheif does not know leave what "unspecified" means.
  heif_nclx_color_profile_set_color_primaries(points, picture.primaries);
  heif_nclx_color_profile_set_transfer_characteristics(points, picture.transfer);
  heif_nclx_color_profile_set_matrix_coefficients(points, picture.matrix);
  points->full_range_flag = picture.full_range;
  heif_image_set_nclx_color_profile(image, points);
  heif_nclx_color_profile_free(points);
  coded_pixels += uint64_t(picture.width) * picture.height;
  *out = image;
  return kHeifOk;
}

}  // namespace litags
