// AV1 pictures of AVIF files, by dav1d.
#include <dav1d/dav1d.h>

#include <cerrno>
#include <memory>
#include <string>

#include "engine/core/camera.h"
#include "engine/io/heif_codecs.h"

namespace litags {
namespace {

struct Decoder {
  Dav1dContext* context = nullptr;
  std::string data;

  ~Decoder() { dav1d_close(&context); }
};

heif_error NewDecoder(void** out) {
  auto decoder = std::make_unique<Decoder>();
  Dav1dSettings settings;
  dav1d_default_settings(&settings);
  settings.n_threads = 1;
  settings.max_frame_delay = 1;
  settings.all_layers = 0;
  settings.frame_size_limit = kMaxImagePixels;
  settings.logger.callback = nullptr;  // errors are returned
  if (dav1d_open(&decoder->context, &settings) != 0) {
    return CodecError("there is no memory to decode it");
  }
  *out = decoder.release();
  return kHeifOk;
}

void FreeDecoder(void* decoder) { delete static_cast<Decoder*>(decoder); }

heif_error PushData(void* decoder, const void* data, size_t size) {
  static_cast<Decoder*>(decoder)->data.append(static_cast<const char*>(data), size);
  return kHeifOk;
}

// A picture; freed with its memory.
struct Picture : Dav1dPicture {
  Picture() : Dav1dPicture{} {}
  ~Picture() { dav1d_picture_unref(this); }
};

// 0, or dav1d's error. `data` must live as long as the picture.
int DecodeFirst(Dav1dContext* context, const std::string& data, Picture* picture) {
  Dav1dData input = {};
  const auto keep = [](const uint8_t*, void*) {};
  int error = dav1d_data_wrap(&input, reinterpret_cast<const uint8_t*>(data.data()), data.size(),
                              keep, nullptr);
  while (error == 0) {
    const size_t before = input.sz;
    if (input.sz > 0) error = dav1d_send_data(context, &input);
    if (error != 0 && error != DAV1D_ERR(EAGAIN)) break;
    error = dav1d_get_picture(context, picture);
    if (error == 0) break;
    if (error == DAV1D_ERR(EAGAIN) && input.sz < before) error = 0;
  }
  if (input.sz > 0) dav1d_data_unref(&input);
  return error;
}

heif_error Copy(const Dav1dPicture& from, heif_image** out) {
  constexpr heif_chroma kChroma[] = {heif_chroma_monochrome, heif_chroma_420, heif_chroma_422,
                                     heif_chroma_444};  // by Dav1dPixelLayout
  CodedPicture picture;
  picture.width = from.p.w;
  picture.height = from.p.h;
  picture.bits = from.p.bpc;
  picture.chroma = kChroma[from.p.layout];
  for (int c = 0; c < 3; ++c) {
    picture.planes[c] = static_cast<const uint8_t*>(from.data[c]);
    picture.strides[c] = from.stride[c == 0 ? 0 : 1];
  }
  const Dav1dSequenceHeader& header = *from.seq_hdr;
  picture.kind = {.matrix = static_cast<int>(header.mtrx),
                  .primaries = static_cast<int>(header.pri),
                  .transfer = static_cast<int>(header.trc),
                  .full_range = header.color_range != 0,
                  .bits = picture.bits};
  if (header.chr != DAV1D_CHR_UNKNOWN) picture.site_x = ChromaSite::kFirst;
  if (header.chr == DAV1D_CHR_COLOCATED) picture.site_y = ChromaSite::kFirst;
  return CopyPicture(picture, out);
}

heif_error DecodeImage(void* self, heif_image** out) {
  auto* decoder = static_cast<Decoder*>(self);
  Picture picture;
  const int error = decoder->data.empty() ? DAV1D_ERR(EINVAL)
                                          : DecodeFirst(decoder->context, decoder->data, &picture);
  if (error == DAV1D_ERR(ERANGE)) return CodecSizeError();
  if (error == DAV1D_ERR(EAGAIN)) {
    return {heif_error_Decoder_plugin_error, heif_suberror_End_of_data, "its picture ends early"};
  }
  if (error != 0) return CodecError("its picture is damaged");
  return Copy(picture, out);
}

}  // namespace

const heif_decoder_plugin kAv1Codec = {.plugin_api_version = 3,
                                       .get_plugin_name = [] { return "dav1d in one thread"; },
                                       .init_plugin = nullptr,
                                       .deinit_plugin = nullptr,
                                       .does_support_format =
                                           [](heif_compression_format format) {
                                             return format == heif_compression_AV1 ? kCodecPriority
                                                                                   : 0;
                                           },
                                       .new_decoder = NewDecoder,
                                       .free_decoder = FreeDecoder,
                                       .push_data = PushData,
                                       .decode_image = DecodeImage,
                                       .set_strict_decoding = [](void*, int) {},
                                       .id_name = "litags-av1"};

}  // namespace litags
