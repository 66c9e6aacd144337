#include "engine/video/testing_video.h"

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/channel_layout.h>
#include <libavutil/opt.h>
#include <libavutil/pixdesc.h>
#include <libavutil/spherical.h>
#include <libswscale/swscale.h>
}

#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <numbers>

#include "engine/core/rng.h"

namespace litags {
namespace {

constexpr int kSoundRate = 8000;

// The video while it is written. Tests only: what cannot fail is not looked at.
class Encoder {
 public:
  explicit Encoder(const TestVideo& options) : options_(options) {}
  ~Encoder() {
    avcodec_free_context(&codec_);
    if (format_ != nullptr) avformat_free_context(format_);
    av_frame_free(&frame_);
    av_packet_free(&packet_);
    sws_freeContext(scaler_);
  }

  std::string Encode(const std::vector<ImageU8>& frames) {
    av_log_set_level(AV_LOG_ERROR);
    avformat_alloc_output_context2(&format_, nullptr, options_.container.c_str(), nullptr);
    std::string path = (std::filesystem::temp_directory_path() / "litags-XXXXXX").string();
    const int fd = mkstemp(path.data());
    if (fd >= 0) close(fd);
    if (format_ == nullptr || avio_open(&format_->pb, path.c_str(), AVIO_FLAG_WRITE) < 0) return "";
    packet_ = av_packet_alloc();
    frame_ = av_frame_alloc();
    const bool ready =
        options_.with_sound_only ? OpenSound() : OpenPictures(frames[0].width, frames[0].height);
    if (options_.sound_seconds > 0) AddSilence();
    AVDictionary* how = nullptr;
    if (options_.contents_first) av_dict_set(&how, "movflags", "frag_keyframe+empty_moov", 0);
    const bool begun = ready && avformat_write_header(format_, &how) >= 0;
    av_dict_free(&how);
    if (begun) {
      if (options_.with_sound_only) {
        WriteSound();
      } else {
        for (size_t i = 0; i < frames.size(); ++i) Write(frames[i], static_cast<int64_t>(i));
      }
      Send(nullptr);
      for (int i = 0; i < options_.sound_seconds; ++i) WriteSilence(i);
      av_write_trailer(format_);
    }
    avio_closep(&format_->pb);
    std::ifstream in(path, std::ios::binary);
    const std::string result(std::istreambuf_iterator<char>(in), {});
    std::filesystem::remove(path);
    return begun ? result : "";
  }

 private:
  bool Open(const AVCodec* encoder) {
    if (format_->oformat->flags & AVFMT_GLOBALHEADER) {
      codec_->flags |= AV_CODEC_FLAG_GLOBAL_HEADER;
    }
    codec_->thread_count = 1;
    if (avcodec_open2(codec_, encoder, nullptr) < 0) return false;
    avcodec_parameters_from_context(stream_->codecpar, codec_);
    stream_->time_base = codec_->time_base;
    return true;
  }

  bool OpenPictures(int width, int height) {
    const AVCodec* encoder = avcodec_find_encoder_by_name(options_.codec.c_str());
    if (encoder == nullptr) return false;
    codec_ = avcodec_alloc_context3(encoder);
    stream_ = avformat_new_stream(format_, nullptr);
    codec_->width = width;
    codec_->height = height;
    codec_->pix_fmt = av_get_pix_fmt(options_.pixels.c_str());
    codec_->time_base = {1, options_.frames_per_second};
    codec_->framerate = {options_.frames_per_second, 1};
    codec_->sample_aspect_ratio = {options_.aspect_num, options_.aspect_den};
    stream_->sample_aspect_ratio = codec_->sample_aspect_ratio;
    codec_->color_range = options_.full_range ? AVCOL_RANGE_JPEG : AVCOL_RANGE_MPEG;
    codec_->colorspace = options_.bt2020_hlg ? AVCOL_SPC_BT2020_NCL
                         : options_.bt601    ? AVCOL_SPC_SMPTE170M
                                             : AVCOL_SPC_BT709;
    codec_->color_primaries = options_.bt2020_hlg ? AVCOL_PRI_BT2020 : AVCOL_PRI_BT709;
    codec_->color_trc = options_.bt2020_hlg ? AVCOL_TRC_ARIB_STD_B67
                        : options_.pq       ? AVCOL_TRC_SMPTE2084
                                            : AVCOL_TRC_BT709;
    codec_->bit_rate = 20'000'000;
    if (options_.interlaced) codec_->flags |= AV_CODEC_FLAG_INTERLACED_DCT;
    av_opt_set(codec_->priv_data, "crf", options_.quality.c_str(), 0);
    av_opt_set(codec_->priv_data, "bits_per_mb", "8000", 0);
    av_opt_set(codec_->priv_data, "preset", "ultrafast", 0);
    av_opt_set(codec_->priv_data, "x265-params", "log-level=none:pools=none:frame-threads=1", 0);
    if (!Open(encoder)) return false;
    if (options_.quarters != 0 || options_.mirror) {
      auto* matrix = reinterpret_cast<int32_t*>(
          av_stream_new_side_data(stream_, AV_PKT_DATA_DISPLAYMATRIX, 9 * sizeof(int32_t)));
      // As ISO/IEC 14496-12 has it: x' = a x + c y, y' = b x + d y, with y downwards.
      constexpr int32_t kOne = 1 << 16, kTurns[4][4] = {{kOne, 0, 0, kOne},
                                                        {0, kOne, -kOne, 0},
                                                        {-kOne, 0, 0, -kOne},
                                                        {0, -kOne, kOne, 0}};
      const int32_t* turn = kTurns[options_.quarters & 3];
      const int32_t side = options_.mirror ? -1 : 1;
      const int32_t values[9] = {side * turn[0], side * turn[1], 0, turn[2], turn[3], 0, 0, 0,
                                 1 << 30};
      std::copy_n(values, 9, matrix);
    }
    if (!options_.sphere.empty()) {
      size_t size = 0;
      AVSphericalMapping* sphere = av_spherical_alloc(&size);
      sphere->projection =
          static_cast<AVSphericalProjection>(av_spherical_from_name(options_.sphere.c_str()));
      av_stream_add_side_data(stream_, AV_PKT_DATA_SPHERICAL, reinterpret_cast<uint8_t*>(sphere),
                              size);
    }
    frame_->format = codec_->pix_fmt;
    frame_->colorspace = codec_->colorspace;
    frame_->color_primaries = codec_->color_primaries;
    frame_->color_trc = codec_->color_trc;
    frame_->color_range = codec_->color_range;
    frame_->width = width;
    frame_->height = height;
    av_frame_get_buffer(frame_, 0);
    scaler_ = sws_getContext(width, height, AV_PIX_FMT_RGB24, width, height, codec_->pix_fmt,
                             SWS_BICUBIC | SWS_ACCURATE_RND, nullptr, nullptr, nullptr);
    const int* table = sws_getCoefficients(options_.bt2020_hlg ? SWS_CS_BT2020
                                           : options_.bt601    ? SWS_CS_ITU601
                                                               : SWS_CS_ITU709);
    sws_setColorspaceDetails(scaler_, table, 1, table, options_.full_range, 0, 1 << 16, 1 << 16);
    return true;
  }

  bool OpenSound() {
    const AVCodec* encoder = avcodec_find_encoder(AV_CODEC_ID_PCM_S16LE);
    codec_ = avcodec_alloc_context3(encoder);
    stream_ = avformat_new_stream(format_, nullptr);
    codec_->sample_rate = kSoundRate;
    codec_->sample_fmt = AV_SAMPLE_FMT_S16;
    av_channel_layout_default(&codec_->ch_layout, 1);
    codec_->time_base = {1, kSoundRate};
    return Open(encoder);
  }

  void WriteSound() {
    frame_->format = AV_SAMPLE_FMT_S16;
    frame_->nb_samples = kSoundRate;
    av_channel_layout_default(&frame_->ch_layout, 1);
    av_frame_get_buffer(frame_, 0);
    std::memset(frame_->data[0], 0, size_t{2} * kSoundRate);
    frame_->pts = 0;
    Send(frame_);
  }

  // A stream of PCM behind that of the pictures.
  void AddSilence() {
    AVCodecParameters* sound = avformat_new_stream(format_, nullptr)->codecpar;
    sound->codec_type = AVMEDIA_TYPE_AUDIO;
    sound->codec_id = AV_CODEC_ID_PCM_S16LE;
    sound->format = AV_SAMPLE_FMT_S16;
    sound->sample_rate = kSoundRate;
    sound->bits_per_coded_sample = 16;
    sound->block_align = 2;
    av_channel_layout_default(&sound->ch_layout, 1);
  }

  void WriteSilence(int second) {
    av_new_packet(packet_, 2 * kSoundRate);
    std::memset(packet_->data, 0, static_cast<size_t>(packet_->size));
    packet_->stream_index = 1;
    packet_->pts = packet_->dts = second;
    packet_->duration = 1;
    packet_->flags |= AV_PKT_FLAG_KEY;
    av_packet_rescale_ts(packet_, {1, 1}, format_->streams[1]->time_base);
    av_interleaved_write_frame(format_, packet_);
  }

  void Write(const ImageU8& picture, int64_t index) {
    av_frame_make_writable(frame_);
    const uint8_t* planes[] = {picture.data.data()};
    const int strides[] = {3 * picture.width};
    sws_scale(scaler_, planes, strides, 0, picture.height, frame_->data, frame_->linesize);
    frame_->pts = options_.gap * index;
    frame_->interlaced_frame = options_.interlaced;
    frame_->top_field_first = options_.interlaced;
    Send(frame_);
  }

  void Send(const AVFrame* frame) {
    if (avcodec_send_frame(codec_, frame) < 0) return;
    while (avcodec_receive_packet(codec_, packet_) >= 0) {
      av_packet_rescale_ts(packet_, codec_->time_base, stream_->time_base);
      packet_->stream_index = 0;
      packet_->duration = std::max<int64_t>(
          packet_->duration, av_rescale_q(options_.gap, codec_->time_base, stream_->time_base));
      av_interleaved_write_frame(format_, packet_);
    }
  }

  const TestVideo options_;
  AVFormatContext* format_ = nullptr;
  AVCodecContext* codec_ = nullptr;
  AVStream* stream_ = nullptr;
  AVFrame* frame_ = nullptr;
  AVPacket* packet_ = nullptr;
  SwsContext* scaler_ = nullptr;
};

// Smooth texture of several sizes, in [0, 1].
class Wall {
 public:
  Wall() {
    for (size_t i = 0; i < waves_.size(); ++i) {
      const CounterRng rng(11, i);
      const double turns = 1 / (8 * std::pow(1.18, double(i)));  // a px
      const double angle = kTurn * rng.Uniform(0);
      waves_[i] = {kTurn * turns * std::cos(angle), kTurn * turns * std::sin(angle),
                   kTurn * rng.Uniform(1)};
    }
  }
  float At(double x, double y) const {
    double sum = 0;
    for (const auto& [a, b, phase] : waves_) sum += std::sin(a * x + b * y + phase);
    return static_cast<float>(std::clamp(0.5 + 0.09 * sum, 0.0, 1.0));
  }

 private:
  static constexpr double kTurn = 2 * std::numbers::pi;
  std::array<std::array<double, 3>, 24> waves_;
};

}  // namespace

std::string EncodeVideo(const std::vector<ImageU8>& frames, const TestVideo& options) {
  return Encoder(options).Encode(frames);
}

ImageU8 OnItsSide(const ImageU8& image) {
  ImageU8 out(image.height, image.width);
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      std::copy_n(image.pixel(x, y), 3, out.pixel(y, image.width - 1 - x));
    }
  }
  return out;
}

std::vector<ImageU8> WalkFrames(int width, int height, int count, double step,
                                const std::vector<int>& blurred) {
  constexpr int kBlur = 12;  // px that a blurred frame moves before and after its middle
  const int wide = width + static_cast<int>(std::ceil(step * count)) + 2 * kBlur + 1;
  std::vector<float> wall(size_t(wide) * height);
  const Wall texture;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < wide; ++x) wall[size_t(y) * wide + x] = texture.At(x, y);
  }
  std::vector<ImageU8> frames;
  for (int i = 0; i < count; ++i) {
    const int reach = std::count(blurred.begin(), blurred.end(), i) > 0 ? kBlur : 0;
    const auto left = static_cast<size_t>(kBlur + std::lround(i * step));
    ImageU8 frame(width, height);
    for (int y = 0; y < height; ++y) {
      const float* row = &wall[size_t(y) * wide + left];
      for (int x = 0; x < width; ++x) {
        float sum = 0;
        for (int k = -reach; k <= reach; ++k) sum += row[x + k];
        const float level = sum / static_cast<float>(2 * reach + 1);
        uint8_t* pixel = frame.pixel(x, y);
        pixel[0] = static_cast<uint8_t>(std::lround(40 + 180 * level));
        pixel[1] = static_cast<uint8_t>(std::lround(30 + 160 * level));
        pixel[2] = static_cast<uint8_t>(std::lround(20 + 120 * level));
      }
    }
    frames.push_back(std::move(frame));
  }
  return frames;
}

}  // namespace litags
