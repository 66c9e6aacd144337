#include "engine/video/video_file.h"

extern "C" {
#include <libavutil/display.h>
#include <libavutil/pixdesc.h>
#include <libavutil/spherical.h>
}

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "engine/core/counted.h"
#include "engine/core/error.h"
#include "engine/io/image_io.h"
#include "engine/io/photo_format.h"
#include "engine/video/ffmpeg.h"
#include "engine/video/frame_picture.h"
#include "engine/video/video_color.h"

namespace litags {
namespace {

// What FFmpeg may use of itself. No playlists: they name other files and addresses.
constexpr char kContainers[] = "mov,matroska,avi,mpegts";
constexpr char kCodecs[] = "h264,hevc,libdav1d,vp8,vp9,libvpx-vp9,mpeg2video,mpeg4,mjpeg,prores";
constexpr size_t kMaxOneAllocation = size_t{1} << 30;
constexpr int kIoBytes = 64 << 10;
constexpr int64_t kProbeBytes = 8 << 20;
constexpr int64_t kAnalyzeMicroseconds = 5'000'000;
// Packets without a frame, such as damaged ones, for each frame that may come.
constexpr int64_t kPacketsAFrame = 4;
// A video that ends this much before it should has lost its end.
constexpr double kShareThatIsThere = 0.95, kSecondsToSpare = 1;
constexpr char kToH264[] =
    "convert it to H.264 with 8 bits, as with ffmpeg -i IN -pix_fmt yuv420p OUT.mp4";

struct Memory {
  std::string_view bytes;
  int64_t at = 0;
};

int ReadMemory(void* opaque, uint8_t* out, int wanted) {
  auto* memory = static_cast<Memory*>(opaque);
  const int64_t left = static_cast<int64_t>(memory->bytes.size()) - memory->at;
  const auto n = static_cast<int>(std::min<int64_t>(wanted, left));
  if (n <= 0) return AVERROR_EOF;
  std::memcpy(out, memory->bytes.data() + memory->at, static_cast<size_t>(n));
  memory->at += n;
  return n;
}

int64_t SeekMemory(void* opaque, int64_t offset, int whence) {
  auto* memory = static_cast<Memory*>(opaque);
  const auto size = static_cast<int64_t>(memory->bytes.size());
  if (whence == AVSEEK_SIZE) return size;
  const int64_t from = whence == SEEK_CUR ? memory->at : whence == SEEK_END ? size : 0;
  if (offset < -from || offset > size - from) return AVERROR(EINVAL);
  return memory->at = from + offset;
}

int OpenNothing(AVFormatContext*, AVIOContext**, const char*, int, AVDictionary**) {
  return AVERROR(EPERM);
}

// How the picture must be turned to stand upright, as EXIF numbers it.
int OrientationOf(const AVStream& stream) {
  size_t size = 0;
  const uint8_t* data = av_stream_get_side_data(&stream, AV_PKT_DATA_DISPLAYMATRIX, &size);
  if (data == nullptr || size < 9 * sizeof(int32_t)) return 1;
  int32_t matrix[9];
  std::memcpy(matrix, data, sizeof(matrix));
  const double degrees = -av_display_rotation_get(matrix);
  const auto quarters =
      std::isfinite(degrees) ? static_cast<int>(std::lround(degrees / 90)) & 3 : 0;
  const bool mirror = double(matrix[0]) * matrix[4] < double(matrix[1]) * matrix[3];
  constexpr int kTurned[] = {1, 6, 3, 8};    // clockwise
  constexpr int kMirrored[] = {4, 5, 2, 7};  // the same after up and down changed places
  return mirror ? kMirrored[quarters] : kTurned[quarters];
}

bool IsOnTheList(absl::string_view codec) {
  const std::vector<absl::string_view> codecs = absl::StrSplit(kCodecs, ',');
  return std::find(codecs.begin(), codecs.end(), codec) != codecs.end();
}

std::string NameOf(const char* name) { return name == nullptr ? "unknown" : name; }

class RealVideoFile : public VideoFile {
 public:
  RealVideoFile(std::string_view bytes, std::string field, const VideoLimits& limits)
      : memory_{bytes}, field_(std::move(field)), limits_(limits) {}

  absl::Status Init() {
    LITAGS_RETURN_IF_ERROR(OpenContainer());
    LITAGS_RETURN_IF_ERROR(ChooseStream());
    return OpenCodec();
  }

  const VideoInfo& info() const override { return info_; }
  double Seconds() const override { return seconds_; }

  double WholeSeconds() const override {
    const double there = of_longest_stream_ ? last_end_ : seconds_ + frame_seconds_;
    return there < kShareThatIsThere * info_.seconds - kSecondsToSpare ? info_.seconds : 0;
  }

  int64_t DamagedFrames() const override { return damaged_; }

  absl::StatusOr<bool> Next() override {
    for (;;) {
      const int got = avcodec_receive_frame(codec_.get(), frame_.get());
      if (got == AVERROR_EOF || damaged_ > limits_.max_frames) return End();
      if (got == AVERROR(EAGAIN)) {
        LITAGS_RETURN_IF_ERROR(Feed());
        continue;
      }
      LITAGS_RETURN_IF_ERROR(CheckMemory(got));
      const bool whole = got >= 0 && frame_->decode_error_flags == 0 &&
                         (frame_->flags & AV_FRAME_FLAG_CORRUPT) == 0;
      if (!whole) {
        ++damaged_;
        continue;
      }
      LITAGS_RETURN_IF_ERROR(CheckFrame());
      return true;
    }
  }

  Planes Luma(int side) const override { return LumaOf(*frame_, side); }

  Photo Picture() const override {
    const bool swap = SwapsSides();
    const int width = swap ? info_.height : info_.width, height = swap ? info_.width : info_.height;
    return TurnUpright(ResizeArea(PictureOf(*frame_), width, height), orientation_);
  }

 private:
  bool SwapsSides() const { return orientation_ >= 5; }

  absl::Status Refuse(std::string_view reason, const std::string& message) const {
    return InvalidInput(reason, field_, absl::StrCat(field_, ": ", message));
  }

  absl::Status Corrupt(std::string_view what) const {
    return Refuse("VIDEO_CORRUPT",
                  absl::StrCat(absl::string_view(what.data(), what.size()),
                               "; copy it from the camera again, or save it anew with another "
                               "program"));
  }

  // Of what FFmpeg gives back. Its other errors are all of what is in the file: damage makes it say
  // EINVAL, EPERM and ENOSYS, too. Its bytes come from memory: none is of reading.
  absl::Status CheckMemory(int result) const {
    return result == AVERROR(ENOMEM) ? VideoTooCostly(field_, "memory") : absl::OkStatus();
  }

  absl::Status CheckOpened(int result, std::string_view what) const {
    LITAGS_RETURN_IF_ERROR(CheckMemory(result));
    return result < 0 ? Corrupt(what) : absl::OkStatus();
  }

  absl::Status OpenContainer() {
    if (!IsVideo(memory_.bytes)) {
      return Refuse("VIDEO_NOT_RECOGNIZED",
                    "is no video that is read (MP4, MOV, Matroska, WebM, AVI, MPEG-TS); convert it "
                    "to MP4");
    }
    io_.reset(avio_alloc_context(static_cast<uint8_t*>(av_malloc(kIoBytes)), kIoBytes, 0, &memory_,
                                 ReadMemory, nullptr, SeekMemory));
    AVFormatContext* format = avformat_alloc_context();
    if (io_ == nullptr || format == nullptr) return VideoTooCostly(field_, "memory");
    format->pb = io_.get();
    format->flags |= AVFMT_FLAG_CUSTOM_IO;
    format->format_whitelist = av_strdup(kContainers);
    format->codec_whitelist = av_strdup(kCodecs);
    format->io_open = OpenNothing;
    format->probesize = kProbeBytes;
    format->max_analyze_duration = kAnalyzeMicroseconds;
    LITAGS_RETURN_IF_ERROR(
        CheckOpened(avformat_open_input(&format, nullptr, nullptr, nullptr),  // or frees it
                    "is damaged or ends early: its table of contents cannot be read"));
    format_.reset(format);
    return CheckOpened(avformat_find_stream_info(format, nullptr),
                       "is damaged or ends early: nothing of it can be decoded");
  }

  absl::Status ChooseStream() {
    const AVStream* best = nullptr;
    const auto area = [](const AVStream& s) {
      return int64_t{s.codecpar->width} * s.codecpar->height;
    };
    for (unsigned i = 0; i < format_->nb_streams; ++i) {
      AVStream* stream = format_->streams[i];
      stream->discard = AVDISCARD_ALL;
      const bool pictures = stream->codecpar->codec_type == AVMEDIA_TYPE_VIDEO &&
                            (stream->disposition & AV_DISPOSITION_ATTACHED_PIC) == 0;
      if (pictures && (best == nullptr || area(*stream) > area(*best))) best = stream;
    }
    if (best == nullptr) {
      return Refuse("VIDEO_WITHOUT_PICTURES",
                    "has no pictures, as a recording of sound; give the video itself");
    }
    stream_ = format_->streams[best->index];
    stream_->discard = AVDISCARD_DEFAULT;
    return Measure();
  }

  // What the container says of size and length.
  absl::Status Measure() {
    const AVCodecParameters& params = *stream_->codecpar;
    if (params.width <= 0 || params.height <= 0) return Corrupt("states no size of its pictures");
    orientation_ = OrientationOf(*stream_);
    const AVRational aspect = av_guess_sample_aspect_ratio(format_.get(), stream_, nullptr);
    const double ratio = aspect.num > 0 && aspect.den > 0 ? av_q2d(aspect) : 1;
    const double stretched_width = params.width * std::max(1.0, ratio);
    const double stretched_height = params.height * std::max(1.0, 1 / ratio);
    if (stretched_width > limits_.max_side || stretched_height > limits_.max_side ||
        stretched_width * stretched_height > static_cast<double>(limits_.max_pixels)) {
      return Refuse("VIDEO_TOO_LARGE",
                    absl::StrFormat("frames of %dx%d px (%.3g:1) exceed %d px a side or %d "
                                    "pixels; scale the video down",
                                    params.width, params.height, ratio, limits_.max_side,
                                    limits_.max_pixels));
    }
    info_.width = static_cast<int>(std::lround(stretched_width));
    info_.height = static_cast<int>(std::lround(stretched_height));
    if (SwapsSides()) std::swap(info_.width, info_.height);
    // Matroska states one length, that of the longest of its streams: sound may go on for longer.
    of_longest_stream_ =
        stream_->duration <= 0 || std::string_view(format_->iformat->name).starts_with("matroska");
    if (of_longest_stream_) {
      for (unsigned i = 0; i < format_->nb_streams; ++i) {
        format_->streams[i]->discard = AVDISCARD_DEFAULT;
      }
    }
    if (stream_->duration > 0) {
      info_.seconds = double(stream_->duration) * av_q2d(stream_->time_base);
    } else if (format_->duration > 0) {
      info_.seconds = double(format_->duration) / AV_TIME_BASE;
    }
    info_.frames = std::max<int64_t>(0, stream_->nb_frames);
    const AVPixFmtDescriptor* pixels =
        av_pix_fmt_desc_get(static_cast<AVPixelFormat>(stream_->codecpar->format));
    if (pixels != nullptr) info_.bits = pixels->comp[0].depth;
    LITAGS_RETURN_IF_ERROR(CheckProjection());
    return CheckLength(info_.seconds, info_.frames);
  }

  // Of videos for 360 degrees.
  absl::Status CheckProjection() {
    const uint8_t* data = av_stream_get_side_data(stream_, AV_PKT_DATA_SPHERICAL, nullptr);
    if (data == nullptr) return absl::OkStatus();
    const AVSphericalProjection projection =
        reinterpret_cast<const AVSphericalMapping*>(data)->projection;
    info_.panorama = projection == AV_SPHERICAL_EQUIRECTANGULAR && info_.width == 2 * info_.height;
    if (info_.panorama) return absl::OkStatus();
    return Unsupported(absl::StrFormat("is a 360-degree video (%s) of %dx%d px",
                                       NameOf(av_spherical_projection_name(projection)),
                                       info_.width, info_.height),
                       "save it as one equirectangular picture of all directions, twice as wide "
                       "as high");
  }

  absl::Status CheckLength(double seconds, int64_t frames) const {
    if (seconds <= limits_.max_seconds && frames <= limits_.max_frames) return absl::OkStatus();
    return Refuse(
        "VIDEO_TOO_LONG",
        absl::StrFormat("is longer than %.0f minutes or %d frames; cut out the part that "
                        "shows the scene, as with ffmpeg -ss 0:30 -t 60 -i IN -c copy OUT",
                        limits_.max_seconds / 60, limits_.max_frames));
  }

  absl::Status OpenCodec() {
    const AVCodecParameters& params = *stream_->codecpar;
    const AVCodec* decoder = params.codec_id == AV_CODEC_ID_AV1
                                 ? avcodec_find_decoder_by_name("libdav1d")
                                 : avcodec_find_decoder(params.codec_id);
    if (decoder == nullptr || !IsOnTheList(decoder->name)) {
      return Unsupported(
          absl::StrCat("its codec, ", NameOf(avcodec_get_name(params.codec_id)), ", is not read"));
    }
    codec_.reset(avcodec_alloc_context3(decoder));
    packet_.reset(av_packet_alloc());
    frame_.reset(av_frame_alloc());
    if (codec_ == nullptr || packet_ == nullptr || frame_ == nullptr) {
      return VideoTooCostly(field_, "memory");
    }
    avcodec_parameters_to_context(codec_.get(), &params);
    codec_->thread_count = 1;
    codec_->max_pixels = limits_.max_pixels;
    codec_->pkt_timebase = stream_->time_base;
    return CheckOpened(avcodec_open2(codec_.get(), decoder, nullptr),
                       "is damaged: its pictures cannot be decoded");
  }

  absl::Status Unsupported(const std::string& what, const char* remedy = kToH264) const {
    return Refuse("VIDEO_UNSUPPORTED", absl::StrCat(what, "; ", remedy));
  }

  // Hands the decoder the next packet, or tells it that there are no more.
  absl::Status Feed() {
    for (;;) {
      const int read = av_read_frame(format_.get(), packet_.get());
      LITAGS_RETURN_IF_ERROR(CheckMemory(read));
      if (read < 0) return Send(nullptr);  // damage that cannot be read past ends it, too
      NoteEndOfPacket();
      const bool ours = packet_->stream_index == stream_->index;
      packets_ += ours;
      if (packets_ > kPacketsAFrame * limits_.max_frames) return CheckLength(0, packets_);
      if (ours) {
        const absl::Status sent = Send(packet_.get());
        av_packet_unref(packet_.get());
        return sent;
      }
      av_packet_unref(packet_.get());
    }
  }

  // To the decoder, which decodes then already; null: there are no more.
  absl::Status Send(const AVPacket* packet) {
    const int sent = avcodec_send_packet(codec_.get(), packet);
    LITAGS_RETURN_IF_ERROR(CheckMemory(sent));
    damaged_ += sent < 0;
    return absl::OkStatus();
  }

  void NoteEndOfPacket() {
    if (packet_->pts == AV_NOPTS_VALUE) return;
    const AVRational unit = format_->streams[packet_->stream_index]->time_base;
    last_end_ =
        std::max(last_end_, (double(packet_->pts) + double(packet_->duration)) * av_q2d(unit));
  }

  absl::StatusOr<bool> End() const {
    if (frames_ > 0) return false;
    return Corrupt("is damaged: none of its frames can be decoded");
  }

  absl::Status CheckFrame() {
    const AVFrame& frame = *frame_;
    ++frames_;
    const int64_t stamp = frame.best_effort_timestamp;
    if (frames_ == 1) {
      first_stamp_ = stamp;
    } else if (frame.width != stored_width_ || frame.height != stored_height_) {
      return Unsupported("its frames change their size");
    }
    stored_width_ = frame.width;
    stored_height_ = frame.height;
    if (frame.width != stream_->codecpar->width || frame.height != stream_->codecpar->height) {
      return Corrupt(absl::StrFormat("is damaged: its frames have %dx%d px, and it states %dx%d",
                                     frame.width, frame.height, stream_->codecpar->width,
                                     stream_->codecpar->height));
    }
    if (stamp != AV_NOPTS_VALUE && first_stamp_ != AV_NOPTS_VALUE) {
      seconds_ = double(stamp - first_stamp_) * av_q2d(stream_->time_base);
    }
    frame_seconds_ = double(frame.pkt_duration) * av_q2d(stream_->time_base);
    if (frame.interlaced_frame != 0) {
      return Unsupported("is interlaced: each of its frames shows two moments",
                         "take them apart, as with ffmpeg -i IN -vf bwdif -pix_fmt yuv420p "
                         "OUT.mp4");
    }
    if (HasPqLight(frame)) {
      return Unsupported("has PQ's light (HDR10)",
                         "convert it to HLG, as with ffmpeg -i IN -vf "
                         "zscale=t=arib-std-b67,format=yuv420p10le OUT.mp4");
    }
    if (!HasReadablePixels(frame)) {
      const auto pixels = static_cast<AVPixelFormat>(frame.format);
      return Unsupported(
          absl::StrCat("its pixels, ", NameOf(av_get_pix_fmt_name(pixels)), ", are not read"));
    }
    return CheckLength(seconds_, frames_);
  }

  Memory memory_;
  const std::string field_;
  const VideoLimits limits_;
  // In this order: the later ones use the earlier.
  AvOwned<AVIOContext> io_;
  AvOwned<AVFormatContext> format_;
  AVStream* stream_ = nullptr;
  AvOwned<AVCodecContext> codec_;
  AvOwned<AVPacket> packet_;
  AvOwned<AVFrame> frame_;
  VideoInfo info_;
  int orientation_ = 1;
  int64_t frames_ = 0, packets_ = 0, damaged_ = 0, first_stamp_ = 0;
  int stored_width_ = 0, stored_height_ = 0;
  double seconds_ = 0;              // from the first frame to this one
  double frame_seconds_ = 0;        // that this one lasts
  bool of_longest_stream_ = false;  // info_.seconds
  double last_end_ = 0;             // of the packets of all streams that are read, s
};

constexpr std::string_view kEndings[] = {".mp4",  ".mov", ".m4v", ".3gp",  ".mkv",
                                         ".webm", ".avi", ".mts", ".m2ts", ".ts"};

}  // namespace

absl::Status VideoTooCostly(const std::string& field, const char* what) {
  return InvalidInput("VIDEO_TOO_COSTLY", field,
                      absl::StrCat(field, ": reading it takes more ", what,
                                   " than a video may; make it shorter or smaller"));
}

bool IsVideoName(std::string_view name) {
  const std::string lower = absl::AsciiStrToLower({name.data(), name.size()});
  return std::any_of(std::begin(kEndings), std::end(kEndings), [&](std::string_view ending) {
    return std::string_view(lower).ends_with(ending) && lower.size() > ending.size();
  });
}

std::string VideoEndings() {
  return absl::StrJoin(kEndings, " ",
                       [](std::string* out, std::string_view ending) { out->append(ending); });
}

bool IsVideo(std::string_view bytes) {
  const auto at = [&](size_t i, std::string_view what) {
    return bytes.size() > i && bytes.substr(i).starts_with(what);
  };
  if (at(4, "ftyp")) return FindPhotoFormat(bytes) == nullptr;
  constexpr size_t kPacket = 188, kPacketOfDisks = 192;  // MPEG-TS
  return at(4, "moov") || at(4, "mdat") || at(4, "wide") || at(4, "free") || at(4, "skip") ||
         at(0, "\x1A\x45\xDF\xA3") || (at(0, "RIFF") && at(8, "AVI ")) ||
         (at(0, "G") && at(kPacket, "G") && at(2 * kPacket, "G")) ||
         (at(4, "G") && at(4 + kPacketOfDisks, "G") && at(4 + 2 * kPacketOfDisks, "G"));
}

absl::StatusOr<std::unique_ptr<VideoFile>> VideoFile::Open(std::string_view bytes,
                                                           const std::string& field,
                                                           const VideoLimits& limits) {
  av_log_set_level(AV_LOG_QUIET);
  av_max_alloc(kMaxOneAllocation);
  auto file = std::make_unique<RealVideoFile>(bytes, field, limits);
  LITAGS_RETURN_IF_ERROR(file->Init());
  return file;
}

absl::StatusOr<VideoInfo> CheckVideo(std::string_view bytes, const std::string& field) {
  LITAGS_ASSIGN_OR_RETURN(const auto file, VideoFile::Open(bytes, field));
  for (size_t frame = 0; frame < kMinPhotos; ++frame) {
    LITAGS_ASSIGN_OR_RETURN(const bool more, file->Next());
    if (more) continue;
    return InvalidInput("TOO_FEW_FRAMES", field,
                        absl::StrCat(field, ": has ", Counted(frame, "frame"), "; a scene needs ",
                                     kMinPhotos, " at least, from different places"));
  }
  return file->info();
}

}  // namespace litags
