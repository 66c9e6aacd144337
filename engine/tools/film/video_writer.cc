#include "engine/tools/film/video_writer.h"

extern "C" {
#include <libavutil/opt.h>
}

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <system_error>
#include <utility>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/video/ffmpeg.h"

namespace litags {
namespace {

constexpr int kIoBytes = 64 << 10;

struct Setting {
  const char* name;
  const char* value;
};

// A container, its codec and FFmpeg's encoder of it. Constant quality: a slow flight needs few
// bits, and a fixed rate would be too low for another.
struct Container {
  const char* ending;
  const char* name;  // FFmpeg's
  const char* codec;
  const char* encoder;
  std::vector<Setting> settings;
};

const std::vector<Container>& Containers() {
  static const auto& containers = *new std::vector<Container>{
      // libvpx's advice for video on demand: deadline good, cpu-used 1 to 4, of which 4 is the
      // fastest. crf 24 leaves more than the 31 it advises for 1080p: renderings are looked at for
      // their detail.
      {".webm",
       "webm",
       "VP9",
       "libvpx-vp9",
       {{"crf", "24"}, {"deadline", "good"}, {"cpu-used", "4"}, {"row-mt", "1"}}},
      // "Visually lossless or nearly so", says FFmpeg's guide to x264 of 17 to 18.
      {".mp4", "mp4", "H.264", "libx264", {{"crf", "18"}}}};
  return containers;
}

int WriteFile(void* file, uint8_t* bytes, int count) {
  const auto wanted = static_cast<size_t>(count);
  if (std::fwrite(bytes, 1, wanted, static_cast<std::FILE*>(file)) == wanted) return count;
  return AVERROR(errno);
}

int64_t SeekFile(void* file, int64_t offset, int whence) {
  if (whence == AVSEEK_SIZE) return AVERROR(ENOSYS);
  if (fseeko(static_cast<std::FILE*>(file), offset, whence) != 0) return AVERROR(errno);
  return ftello(static_cast<std::FILE*>(file));
}

class FfmpegWriter : public VideoWriter {
 public:
  FfmpegWriter(std::FILE* file, std::string path, std::string field, int frames_per_second)
      : path_(std::move(path)),
        field_(std::move(field)),
        frames_per_second_(frames_per_second),
        file_(file) {}

  ~FfmpegWriter() override {
    io_.reset();
    if (file_ != nullptr) std::fclose(file_);
  }

  absl::Status Init() {
    for (const Container& container : Containers()) {
      if (absl::EndsWith(absl::AsciiStrToLower(path_), container.ending)) container_ = &container;
    }
    if (container_ == nullptr) {
      return InvalidInput("VIDEO_FORMAT_UNKNOWN", field_,
                          absl::StrCat(path_,
                                       ": the name does not say a video format; end it "
                                       "with .webm or .mp4"));
    }
    return FindEncoder();
  }

  absl::Status Add(const ImageU8& picture) override {
    if (codec_ == nullptr) LITAGS_RETURN_IF_ERROR(Begin(picture.width, picture.height));
    if (picture.width != width_ || picture.height != height_) {
      return InvalidInput(
          "VIDEO_SIZE_CHANGED", field_,
          absl::StrCat(path_, ": a frame has ", picture.width, "x", picture.height,
                       " px, those before have ", width_, "x", height_, "; give all one size"));
    }
    if (av_frame_make_writable(frame_.get()) < 0) return Failed("there is no memory for a frame");
    const uint8_t* planes[] = {picture.data.data()};
    const int strides[] = {3 * picture.width};
    sws_scale(scaler_.get(), planes, strides, 0, frame_->height, frame_->data, frame_->linesize);
    frame_->pts = frames_++;
    return Encode(frame_.get());
  }

  absl::Status Finish() override {
    if (codec_ == nullptr) {
      return InvalidInput("VIDEO_WITHOUT_PICTURES", field_,
                          absl::StrCat(path_, ": no picture came; give at least one"));
    }
    LITAGS_RETURN_IF_ERROR(Encode(nullptr));
    if (av_write_trailer(format_.get()) < 0) return WriteFailed();
    avio_flush(io_.get());
    std::FILE* file = std::exchange(file_, nullptr);
    const bool written = io_->error >= 0;
    return std::fclose(file) == 0 && written ? absl::OkStatus() : WriteFailed();
  }

 private:
  absl::Status FindEncoder() {
    encoder_ = avcodec_find_encoder_by_name(container_->encoder);
    if (encoder_ != nullptr) return absl::OkStatus();
    return MakeError(absl::StatusCode::kFailedPrecondition, "VIDEO_ENCODER_MISSING", field_,
                     absl::StrCat(path_, ": FFmpeg's libraries here cannot write ",
                                  container_->codec, " (", container_->encoder,
                                  "); choose the other of .webm and .mp4, or install a "
                                  "libavcodec with that encoder"));
  }

  // The first frame's size is the video's.
  absl::Status Begin(int width, int height) {
    if (width < 2 || height < 2) {
      return InvalidInput("VIDEO_SIZE_INVALID", field_,
                          absl::StrCat(path_, ": frames of ", width, "x", height,
                                       " px make no video; 2x2 is the least"));
    }
    width_ = width;
    height_ = height;
    AVFormatContext* format = nullptr;
    avformat_alloc_output_context2(&format, nullptr, container_->name, nullptr);
    format_.reset(format);
    io_.reset(avio_alloc_context(static_cast<uint8_t*>(av_malloc(kIoBytes)), kIoBytes,
                                 /*write_flag=*/1, file_, nullptr, WriteFile, SeekFile));
    codec_.reset(avcodec_alloc_context3(encoder_));
    frame_.reset(av_frame_alloc());
    packet_.reset(av_packet_alloc());
    if (!format_ || !io_ || !codec_ || !frame_ || !packet_) return Failed("there is no memory");
    format_->pb = io_.get();
    format_->flags |= AVFMT_FLAG_CUSTOM_IO;
    LITAGS_RETURN_IF_ERROR(OpenCodec(width & ~1, height & ~1));
    LITAGS_RETURN_IF_ERROR(PrepareFrame());
    if (avformat_write_header(format_.get(), nullptr) < 0) return WriteFailed();
    return absl::OkStatus();
  }

  absl::Status OpenCodec(int width, int height) {
    codec_->width = width;
    codec_->height = height;
    codec_->pix_fmt = AV_PIX_FMT_YUV420P;
    codec_->time_base = {1, frames_per_second_};
    codec_->framerate = {frames_per_second_, 1};
    codec_->color_range = AVCOL_RANGE_MPEG;
    codec_->colorspace = AVCOL_SPC_BT709;
    codec_->color_primaries = AVCOL_PRI_BT709;
    codec_->color_trc = AVCOL_TRC_BT709;
    codec_->thread_count = 0;  // as many as there are cores
    if (format_->oformat->flags & AVFMT_GLOBALHEADER) codec_->flags |= AV_CODEC_FLAG_GLOBAL_HEADER;
    for (const auto& [name, value] : container_->settings) {
      if (av_opt_set(codec_.get(), name, value, AV_OPT_SEARCH_CHILDREN) < 0) {
        return Failed(absl::StrCat(container_->encoder, " has no setting ", name));
      }
    }
    AVStream* stream = avformat_new_stream(format_.get(), nullptr);
    if (stream == nullptr || avcodec_open2(codec_.get(), encoder_, nullptr) < 0 ||
        avcodec_parameters_from_context(stream->codecpar, codec_.get()) < 0) {
      return Failed(absl::StrCat(container_->encoder, " does not start"));
    }
    stream->time_base = codec_->time_base;
    stream->avg_frame_rate = codec_->framerate;
    return absl::OkStatus();
  }

  absl::Status PrepareFrame() {
    frame_->format = codec_->pix_fmt;
    frame_->width = codec_->width;
    frame_->height = codec_->height;
    frame_->color_range = codec_->color_range;
    frame_->colorspace = codec_->colorspace;
    scaler_.reset(sws_getContext(frame_->width, frame_->height, AV_PIX_FMT_RGB24, frame_->width,
                                 frame_->height, codec_->pix_fmt,
                                 SWS_BICUBIC | SWS_ACCURATE_RND | SWS_FULL_CHR_H_INP, nullptr,
                                 nullptr, nullptr));
    if (scaler_ == nullptr || av_frame_get_buffer(frame_.get(), 0) < 0) {
      return Failed("there is no memory for a frame");
    }
    const int* bt709 = sws_getCoefficients(SWS_CS_ITU709);
    sws_setColorspaceDetails(scaler_.get(), bt709, /*srcRange=*/1, bt709, /*dstRange=*/0, 0,
                             1 << 16, 1 << 16);
    return absl::OkStatus();
  }

  // A frame, or what the encoder still holds.
  absl::Status Encode(const AVFrame* frame) {
    if (avcodec_send_frame(codec_.get(), frame) < 0) return Failed("a frame cannot be encoded");
    for (;;) {
      const int got = avcodec_receive_packet(codec_.get(), packet_.get());
      if (got == AVERROR(EAGAIN) || got == AVERROR_EOF) return absl::OkStatus();
      if (got < 0) return Failed("a frame cannot be encoded");
      packet_->stream_index = 0;
      packet_->duration = 1;
      av_packet_rescale_ts(packet_.get(), codec_->time_base, format_->streams[0]->time_base);
      if (av_interleaved_write_frame(format_.get(), packet_.get()) < 0) return WriteFailed();
    }
  }

  absl::Status Failed(std::string_view what) const {
    return MakeError(
        absl::StatusCode::kInternal, "VIDEO_NOT_ENCODED", field_,
        absl::StrCat(path_, ": ", std::string(what), "; try the other of .webm and .mp4"));
  }

  absl::Status WriteFailed() const {
    const int error = errno;
    const bool full = error == ENOSPC || error == EDQUOT;
    return MakeError(full ? absl::StatusCode::kResourceExhausted : absl::StatusCode::kDataLoss,
                     full ? "OUTPUT_DISK_FULL" : "OUTPUT_FAILED", field_,
                     absl::StrCat(path_, ": ", std::generic_category().message(error),
                                  "; free some space or write elsewhere"));
  }

  const std::string path_, field_;
  const int frames_per_second_;
  std::FILE* file_;  // null once it is closed
  const Container* container_ = nullptr;
  const AVCodec* encoder_ = nullptr;
  int width_ = 0, height_ = 0;  // of the pictures
  int64_t frames_ = 0;
  AvOwned<AVIOContext> io_;
  AvOwned<AVFormatContext> format_;
  AvOwned<AVCodecContext> codec_;
  AvOwned<AVFrame> frame_;
  AvOwned<AVPacket> packet_;
  AvOwned<SwsContext> scaler_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<VideoWriter>> VideoWriter::Create(std::FILE* file,
                                                                 const std::string& path,
                                                                 int frames_per_second,
                                                                 const std::string& field) {
  av_log_set_level(AV_LOG_ERROR);
  auto writer = std::make_unique<FfmpegWriter>(file, path, field, frames_per_second);
  LITAGS_RETURN_IF_ERROR(writer->Init());
  return writer;
}

}  // namespace litags
