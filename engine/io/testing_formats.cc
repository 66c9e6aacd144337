#include "engine/io/testing_formats.h"

#include <jxl/encode.h>
#include <lcms2.h>
#include <libheif/heif.h>
#include <tiffio.h>
#include <webp/encode.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>

#include "engine/core/check.h"
#include "engine/io/byte_reader.h"

#if defined(__SANITIZE_ADDRESS__)
// The encoder of HEIC keeps some of its memory for good.
extern "C" const char* __lsan_default_suppressions() { return "leak:libx265"; }
#endif

namespace litags {
namespace {

std::string Chunk(const std::string& type, const std::string& data) {
  std::string chunk = type;
  AppendNumber(&chunk, static_cast<uint32_t>(data.size()));
  chunk += data;
  if (data.size() % 2 == 1) chunk += '\0';
  return chunk;
}

std::string Number24(int value) {
  return {static_cast<char>(value), static_cast<char>(value >> 8), static_cast<char>(value >> 16)};
}

// One page's samples as libtiff takes them.
std::string TiffSamples(const DeepImage& image, const TiffLayout& layout, int page, int plane,
                        uint32_t x0, uint32_t y0, uint32_t width, uint32_t height) {
  std::string out;
  const int samples = layout.planar ? 1 : image.channels + layout.extra;
  for (uint32_t y = y0; y < y0 + height; ++y) {
    for (uint32_t x = x0; x < x0 + width; ++x) {
      for (int s = 0; s < samples; ++s) {
        const int c = layout.planar ? plane : s;
        const bool inside = int(x) < image.width && int(y) < image.height && page == 0;
        const uint16_t code = c >= image.channels ? 12345
                              : inside            ? image.pixel(int(x), int(y))[c]
                                                  : 0;
        if (layout.bits == 8) out += static_cast<char>(code / 257);
        if (layout.bits == 16) AppendNumber(&out, code);
        if (layout.bits == 32) AppendNumber(&out, code / 65535.0f * layout.white);
      }
    }
  }
  return out;
}

void WriteTiffPage(TIFF* tiff, const DeepImage& image, const TiffLayout& layout, int page) {
  const uint32_t width = image.width, height = image.height;
  constexpr uint32_t kTile = 16, kRows = 5;
  TIFFSetField(tiff, TIFFTAG_IMAGEWIDTH, width);
  TIFFSetField(tiff, TIFFTAG_IMAGELENGTH, height);
  TIFFSetField(tiff, TIFFTAG_BITSPERSAMPLE, layout.bits);
  TIFFSetField(tiff, TIFFTAG_SAMPLEFORMAT,
               layout.bits == 32 ? SAMPLEFORMAT_IEEEFP : SAMPLEFORMAT_UINT);
  TIFFSetField(tiff, TIFFTAG_SAMPLESPERPIXEL, image.channels + layout.extra);
  TIFFSetField(tiff, TIFFTAG_COMPRESSION, layout.compression);
  TIFFSetField(tiff, TIFFTAG_ORIENTATION, layout.orientation);
  TIFFSetField(tiff, TIFFTAG_PHOTOMETRIC,
               image.channels == 1   ? PHOTOMETRIC_MINISBLACK
               : image.channels == 3 ? PHOTOMETRIC_RGB
                                     : PHOTOMETRIC_SEPARATED);
  TIFFSetField(tiff, TIFFTAG_PLANARCONFIG,
               layout.planar ? PLANARCONFIG_SEPARATE : PLANARCONFIG_CONTIG);
  if (layout.extra > 0) {
    const std::vector<uint16_t> kinds(layout.extra, EXTRASAMPLE_UNASSALPHA);
    TIFFSetField(tiff, TIFFTAG_EXTRASAMPLES, layout.extra, kinds.data());
  }
  if (!layout.icc.empty()) {
    TIFFSetField(tiff, TIFFTAG_ICCPROFILE, uint32_t(layout.icc.size()), layout.icc.data());
  }
  const int planes = layout.planar ? image.channels : 1;
  if (layout.tiled) {
    TIFFSetField(tiff, TIFFTAG_TILEWIDTH, kTile);
    TIFFSetField(tiff, TIFFTAG_TILELENGTH, kTile);
  } else {
    TIFFSetField(tiff, TIFFTAG_ROWSPERSTRIP, kRows);
  }
  const uint32_t step_x = layout.tiled ? kTile : width, step_y = layout.tiled ? kTile : kRows;
  for (int p = 0; p < planes; ++p) {
    for (uint32_t y = 0; y < height; y += step_y) {
      for (uint32_t x = 0; x < width; x += step_x) {
        const uint32_t rows = layout.tiled ? step_y : std::min(step_y, height - y);
        std::string block = TiffSamples(image, layout, page, p, x, y, step_x, rows);
        const auto size = static_cast<tmsize_t>(block.size());
        const uint16_t plane = static_cast<uint16_t>(p);
        LITAGS_CHECK((layout.tiled
                          ? TIFFWriteEncodedTile(tiff, TIFFComputeTile(tiff, x, y, 0, plane),
                                                 block.data(), size)
                          : TIFFWriteEncodedStrip(tiff, TIFFComputeStrip(tiff, y, plane),
                                                  block.data(), size)) == size);
      }
    }
  }
  LITAGS_CHECK(TIFFWriteDirectory(tiff) == 1);
}

// A directory of EXIF behind the first page, which then is written anew to point there.
void AddExposure(TIFF* tiff, const TiffLayout& layout) {
  const auto iso = static_cast<uint16_t>(layout.iso);
  uint64_t at = 0;
  TIFFCreateEXIFDirectory(tiff);
  TIFFSetField(tiff, EXIFTAG_EXPOSURETIME, layout.exposure_time);
  TIFFSetField(tiff, EXIFTAG_FNUMBER, layout.f_number);
  TIFFSetField(tiff, EXIFTAG_ISOSPEEDRATINGS, 1, &iso);
  LITAGS_CHECK(TIFFWriteCustomDirectory(tiff, &at) == 1);
  LITAGS_CHECK(TIFFSetDirectory(tiff, 0) == 1);
  TIFFSetField(tiff, TIFFTAG_EXIFIFD, at);
  LITAGS_CHECK(TIFFRewriteDirectory(tiff) == 1);
}

heif_error AppendBytes(heif_context*, const void* data, size_t size, void* out) {
  static_cast<std::string*>(out)->append(static_cast<const char*>(data), size);
  return {heif_error_Ok, heif_suberror_Unspecified, "ok"};
}

// 4:2:0, full range, BT.601: libheif's own conversion fails for more than 8 bits.
TestYCbCr ToYCbCr(const DeepImage& image, int bits) {
  TestYCbCr picture{.width = image.width, .height = image.height, .bits = bits};
  const double white = (1 << bits) - 1;
  for (int c = 0; c < 3; ++c) {
    const int step = c == 0 ? 1 : 2;
    for (int y = 0; y < picture.height_of(c); ++y) {
      for (int x = 0; x < picture.width_of(c); ++x) {
        const uint16_t* rgb = image.pixel(step * x, step * y);
        const double r = rgb[0] / 65535.0, g = rgb[1] / 65535.0, b = rgb[2] / 65535.0;
        const double luma = 0.299 * r + 0.587 * g + 0.114 * b;
        const double value = c == 0   ? luma
                             : c == 1 ? 0.5 + (b - luma) / 1.772
                                      : 0.5 + (r - luma) / 1.402;
        picture.codes[c].push_back(
            static_cast<uint16_t>(std::clamp(value, 0.0, 1.0) * white + 0.5));
      }
    }
  }
  return picture;
}

// Adds a plane of `codes`, of which the last fills what is missing.
void AddPlane(heif_image* image, heif_channel channel, int width, int height, int bits,
              const std::vector<uint16_t>& codes) {
  heif_image_add_plane(image, channel, width, height, bits);
  int stride = 0;
  uint8_t* row = heif_image_get_plane(image, channel, &stride);
  for (size_t i = 0, y = 0; y < size_t(height); ++y, row += stride) {
    for (int x = 0; x < width; ++x, ++i) {
      const uint16_t code = codes[std::min(i, codes.size() - 1)];
      uint8_t* to = row + (bits > 8 ? 2 * x : x);
      to[0] = static_cast<uint8_t>(code);
      if (bits > 8) to[1] = static_cast<uint8_t>(code >> 8);
    }
  }
}

heif_chroma ChromaOf(const TestYCbCr& picture) {
  return picture.grey          ? heif_chroma_monochrome
         : picture.across == 1 ? heif_chroma_444
         : picture.down == 1   ? heif_chroma_422
                               : heif_chroma_420;
}

heif_image* MakeHeifImage(const TestYCbCr& picture, bool alpha, const std::string& icc) {
  constexpr heif_channel kPlanes[] = {heif_channel_Y, heif_channel_Cb, heif_channel_Cr};
  heif_image* image = nullptr;
  heif_image_create(picture.width, picture.height,
                    picture.grey ? heif_colorspace_monochrome : heif_colorspace_YCbCr,
                    ChromaOf(picture), &image);
  for (int c = 0; c < (picture.grey ? 1 : 3); ++c) {
    AddPlane(image, kPlanes[c], picture.width_of(c), picture.height_of(c), picture.bits,
             picture.codes[c]);
  }
  if (alpha) {
    const auto half = static_cast<uint16_t>(1 << (picture.bits - 1));
    AddPlane(image, heif_channel_Alpha, picture.width, picture.height, picture.bits, {half});
  }
  heif_color_profile_nclx* points = heif_nclx_color_profile_alloc();
  points->color_primaries = heif_color_primaries_ITU_R_BT_709_5;
  points->transfer_characteristics = static_cast<heif_transfer_characteristics>(picture.transfer);
  points->matrix_coefficients = static_cast<heif_matrix_coefficients>(picture.matrix);
  points->full_range_flag = picture.full_range;
  heif_image_set_nclx_color_profile(image, points);
  heif_nclx_color_profile_free(points);
  if (!icc.empty()) heif_image_set_raw_color_profile(image, "prof", icc.data(), icc.size());
  return image;
}

cmsToneCurve* PowerCurve(double exponent) { return cmsBuildGamma(nullptr, exponent); }

cmsHPROFILE RgbProfile(const cmsCIExyYTRIPLE& primaries, double exponent) {
  const cmsCIExyY white = {0.3127, 0.3290, 1};
  cmsToneCurve* curve = PowerCurve(exponent);
  cmsToneCurve* curves[] = {curve, curve, curve};
  const cmsHPROFILE profile = cmsCreateRGBProfile(&white, &primaries, curves);
  cmsFreeToneCurve(curve);
  return profile;
}

// Inks to Lab by way of the light that each leaves.
cmsInt32Number InkToLab(const cmsUInt16Number in[], cmsUInt16Number out[], void* rgb_to_lab) {
  float rgb[3];
  for (int c = 0; c < 3; ++c) rgb[c] = (1 - in[c] / 65535.0f) * (1 - in[3] / 65535.0f);
  cmsCIELab lab;
  cmsDoTransform(rgb_to_lab, rgb, &lab, 1);
  cmsFloat2LabEncodedV2(out, &lab);
  return TRUE;
}

cmsHPROFILE CmykProfile() {
  const cmsHPROFILE srgb = cmsCreate_sRGBProfile(), lab = cmsCreateLab4Profile(nullptr);
  const cmsHTRANSFORM to_lab =
      cmsCreateTransform(srgb, TYPE_RGB_FLT, lab, TYPE_Lab_DBL, INTENT_PERCEPTUAL, 0);
  const cmsHPROFILE profile = cmsCreateProfilePlaceholder(nullptr);
  cmsSetProfileVersion(profile, 2.4);  // of version 4, black would be perceptual: not 0
  cmsSetDeviceClass(profile, cmsSigOutputClass);
  cmsSetColorSpace(profile, cmsSigCmykData);
  cmsSetPCS(profile, cmsSigLabData);
  cmsPipeline* pipeline = cmsPipelineAlloc(nullptr, 4, 3);
  cmsStage* table = cmsStageAllocCLut16bit(nullptr, 9, 4, 3, nullptr);
  cmsStageSampleCLut16bit(table, InkToLab, to_lab, 0);
  // The order that the file format has: curves, table, curves.
  cmsPipelineInsertStage(pipeline, cmsAT_END, cmsStageAllocToneCurves(nullptr, 4, nullptr));
  cmsPipelineInsertStage(pipeline, cmsAT_END, table);
  cmsPipelineInsertStage(pipeline, cmsAT_END, cmsStageAllocToneCurves(nullptr, 3, nullptr));
  cmsWriteTag(profile, cmsSigAToB0Tag, pipeline);
  cmsPipelineFree(pipeline);
  cmsDeleteTransform(to_lab);
  cmsCloseProfile(srgb);
  cmsCloseProfile(lab);
  return profile;
}

}  // namespace

DeepImage Deepen(const ImageU8& image) {
  DeepImage deep{image.width, image.height, 3, {}};
  for (const uint8_t code : image.data) deep.codes.push_back(static_cast<uint16_t>(257 * code));
  return deep;
}

std::string EncodeTestWebp(const ImageU8& image, const Extras& extras, bool lossless) {
  uint8_t* bytes = nullptr;
  const int stride = 3 * image.width;
  const size_t size =
      lossless ? WebPEncodeLosslessRGB(image.data.data(), image.width, image.height, stride, &bytes)
               : WebPEncodeRGB(image.data.data(), image.width, image.height, stride, 95, &bytes);
  const std::string simple(reinterpret_cast<char*>(bytes), size);
  WebPFree(bytes);
  if (extras.icc.empty() && extras.exif.empty()) return simple;
  const char flags =
      static_cast<char>((extras.icc.empty() ? 0 : 0x20) | (extras.exif.empty() ? 0 : 0x08));
  std::string chunks = Chunk("VP8X", std::string(1, flags) + std::string(3, '\0') +
                                         Number24(image.width - 1) + Number24(image.height - 1));
  if (!extras.icc.empty()) chunks += Chunk("ICCP", extras.icc);
  chunks += simple.substr(12);
  if (!extras.exif.empty()) chunks += Chunk("EXIF", extras.exif);
  return Chunk("RIFF", "WEBP" + chunks);
}

std::string EncodeTestWebp(const TestYCbCr& picture, int quality) {
  WebPConfig config;
  LITAGS_CHECK(WebPConfigPreset(&config, WEBP_PRESET_DEFAULT, static_cast<float>(quality)));
  WebPPicture out;
  LITAGS_CHECK(WebPPictureInit(&out));
  out.width = picture.width;
  out.height = picture.height;
  LITAGS_CHECK(WebPPictureAlloc(&out));
  uint8_t* const planes[] = {out.y, out.u, out.v};
  for (int c = 0; c < 3; ++c) {
    const int width = picture.width_of(c), stride = c == 0 ? out.y_stride : out.uv_stride;
    for (size_t i = 0; i < picture.codes[c].size(); ++i) {
      planes[c][i / width * stride + i % width] = static_cast<uint8_t>(picture.codes[c][i]);
    }
  }
  WebPMemoryWriter writer;
  WebPMemoryWriterInit(&writer);
  out.writer = WebPMemoryWrite;
  out.custom_ptr = &writer;
  LITAGS_CHECK(WebPEncode(&config, &out));
  const std::string bytes(reinterpret_cast<char*>(writer.mem), writer.size);
  WebPMemoryWriterClear(&writer);
  WebPPictureFree(&out);
  return bytes;
}

std::string EncodeTestTiff(const DeepImage& image, const TiffLayout& layout) {
  namespace fs = std::filesystem;
  std::string path = (fs::temp_directory_path() / "litags-tiff-XXXXXX").string();
  const int file = ::mkstemp(path.data());
  LITAGS_CHECK(file >= 0);
  TIFF* tiff = TIFFFdOpen(file, path.c_str(), layout.big ? "w8" : "w");
  for (int page = 0; page < layout.pages; ++page) WriteTiffPage(tiff, image, layout, page);
  if (layout.exposure_time > 0) AddExposure(tiff, layout);
  TIFFClose(tiff);
  std::ifstream in(path, std::ios::binary);
  std::string bytes((std::istreambuf_iterator<char>(in)), {});
  fs::remove(path);
  return bytes;
}

std::string EncodeTestHeif(const DeepImage& image, bool av1, int bits, const Extras& extras) {
  return EncodeTestHeif(ToYCbCr(image, bits), {.av1 = av1, .quality = 95}, extras);
}

std::string EncodeTestHeif(const TestYCbCr& picture, const HeifLayout& layout,
                           const Extras& extras) {
  heif_context* context = heif_context_alloc();
  heif_encoder* encoder = nullptr;
  heif_error error = heif_context_get_encoder_for_format(
      context, layout.av1 ? heif_compression_AV1 : heif_compression_HEVC, &encoder);
  LITAGS_CHECK(error.code == heif_error_Ok);
  if (layout.quality == 100) heif_encoder_set_lossless(encoder, 1);
  if (layout.quality < 100) heif_encoder_set_lossy_quality(encoder, layout.quality);
  const char* chroma = picture.across == 1 ? "444" : picture.down == 1 ? "422" : "420";
  heif_encoder_set_parameter_string(encoder, "chroma", chroma);
  heif_encoding_options* options = heif_encoding_options_alloc();
  options->image_orientation = static_cast<heif_orientation>(layout.orientation);
  heif_image* image = MakeHeifImage(picture, layout.alpha, extras.icc);
  heif_image_handle* handle = nullptr;
  error = heif_context_encode_image(context, image, encoder, options, &handle);
  LITAGS_CHECK(error.code == heif_error_Ok);
  if (!extras.exif.empty()) {
    heif_context_add_exif_metadata(context, handle, extras.exif.data(),
                                   static_cast<int>(extras.exif.size()));
  }
  std::string bytes;
  heif_writer writer = {1, AppendBytes};
  heif_context_write(context, &writer, &bytes);
  heif_image_handle_release(handle);
  heif_image_release(image);
  heif_encoding_options_free(options);
  heif_encoder_release(encoder);
  heif_context_free(context);
  return bytes;
}

std::string EncodeTestJxl(const DeepImage& image, int bits, const Extras& extras, int depths,
                          int transfer) {
  const std::unique_ptr<JxlEncoder, void (*)(JxlEncoder*)> encoder(JxlEncoderCreate(nullptr),
                                                                   JxlEncoderDestroy);
  JxlBasicInfo info;
  JxlEncoderInitBasicInfo(&info);
  info.xsize = image.width;
  info.ysize = image.height;
  info.bits_per_sample = bits;
  info.num_color_channels = image.channels;
  info.uses_original_profile = JXL_TRUE;
  info.num_extra_channels = depths;
  JxlEncoderUseContainer(encoder.get(), extras.exif.empty() ? JXL_FALSE : JXL_TRUE);
  if (!extras.exif.empty()) {
    JxlEncoderUseBoxes(encoder.get());
    const std::string box = std::string(4, '\0') + extras.exif;
    JxlEncoderAddBox(encoder.get(), "Exif", reinterpret_cast<const uint8_t*>(box.data()),
                     box.size(), JXL_FALSE);
    JxlEncoderCloseBoxes(encoder.get());
  }
  LITAGS_CHECK(JxlEncoderSetBasicInfo(encoder.get(), &info) == JXL_ENC_SUCCESS);
  if (extras.icc.empty()) {
    JxlColorEncoding colors;
    JxlColorEncodingSetToSRGB(&colors, image.channels == 1);
    colors.transfer_function = static_cast<JxlTransferFunction>(transfer);
    LITAGS_CHECK(JxlEncoderSetColorEncoding(encoder.get(), &colors) == JXL_ENC_SUCCESS);
  } else {
    JxlEncoderSetICCProfile(encoder.get(), reinterpret_cast<const uint8_t*>(extras.icc.data()),
                            extras.icc.size());
  }
  JxlEncoderFrameSettings* settings = JxlEncoderFrameSettingsCreate(encoder.get(), nullptr);
  JxlEncoderSetFrameLossless(settings, JXL_TRUE);
  const bool deep = bits > 8;
  const JxlPixelFormat format = {uint32_t(image.channels), deep ? JXL_TYPE_UINT16 : JXL_TYPE_UINT8,
                                 JXL_NATIVE_ENDIAN, 0};
  std::string pixels;
  for (const uint16_t code : image.codes) {
    deep ? AppendNumber(&pixels, code) : AppendNumber(&pixels, static_cast<uint8_t>(code / 257));
  }
  JxlExtraChannelInfo depth;
  JxlEncoderInitExtraChannelInfo(JXL_CHANNEL_DEPTH, &depth);
  depth.bits_per_sample = 8;
  const std::vector<uint8_t> black(size_t(image.width) * image.height);
  const JxlPixelFormat plane = {1, JXL_TYPE_UINT8, JXL_NATIVE_ENDIAN, 0};
  for (int i = 0; i < depths; ++i) {
    JxlEncoderSetExtraChannelInfo(encoder.get(), i, &depth);
  }
  LITAGS_CHECK(JxlEncoderAddImageFrame(settings, &format, pixels.data(), pixels.size()) ==
               JXL_ENC_SUCCESS);
  for (int i = 0; i < depths; ++i) {
    JxlEncoderSetExtraChannelBuffer(settings, &plane, black.data(), black.size(), i);
  }
  JxlEncoderCloseInput(encoder.get());
  std::string out(size_t{1} << 20, '\0');
  uint8_t* next = reinterpret_cast<uint8_t*>(out.data());
  size_t left = out.size();
  LITAGS_CHECK(JxlEncoderProcessOutput(encoder.get(), &next, &left) == JXL_ENC_SUCCESS);
  out.resize(out.size() - left);
  return out;
}

std::string MakeTestProfile(TestProfile kind) {
  const cmsCIExyYTRIPLE bt709 = {{.64, .33, 1}, {.30, .60, 1}, {.15, .06, 1}},
                        p3 = {{.68, .32, 1}, {.265, .69, 1}, {.15, .06, 1}},
                        adobe = {{.64, .33, 1}, {.21, .71, 1}, {.15, .06, 1}};
  const cmsCIExyY d50 = {0.3457, 0.3585, 1};
  cmsHPROFILE profile = nullptr;
  switch (kind) {
    case TestProfile::kSrgb:
      profile = cmsCreate_sRGBProfile();
      break;
    case TestProfile::kLinear:
      profile = RgbProfile(bt709, 1);
      break;
    case TestProfile::kDisplayP3:
      profile = RgbProfile(p3, 2.2);
      break;
    case TestProfile::kAdobeRgb:
      profile = RgbProfile(adobe, 2.19921875);
      break;
    case TestProfile::kGreyLinear: {
      cmsToneCurve* curve = PowerCurve(1);
      profile = cmsCreateGrayProfile(&d50, curve);
      cmsFreeToneCurve(curve);
      break;
    }
    case TestProfile::kCmyk:
      profile = CmykProfile();
      break;
  }
  cmsUInt32Number size = 0;
  cmsSaveProfileToMem(profile, nullptr, &size);
  std::string icc(size, '\0');
  LITAGS_CHECK(cmsSaveProfileToMem(profile, icc.data(), &size));
  cmsCloseProfile(profile);
  return icc;
}

std::string WithJpegProfile(const std::string& jpeg, const std::string& icc) {
  constexpr size_t kPart = 60000;
  const size_t n = (icc.size() + kPart - 1) / kPart;
  std::string segments;
  for (size_t i = 0; i < n; ++i) {
    const std::string part = std::string("ICC_PROFILE\0", 12) + static_cast<char>(i + 1) +
                             static_cast<char>(n) + icc.substr(i * kPart, kPart);
    const size_t length = part.size() + 2;
    segments += std::string("\xFF\xE2") + static_cast<char>(length >> 8) +
                static_cast<char>(length & 0xFF) + part;
  }
  return jpeg.substr(0, 2) + segments + jpeg.substr(2);
}

}  // namespace litags
