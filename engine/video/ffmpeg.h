// What FFmpeg's libraries give, owned. For sources that include them.
#ifndef LITAGS_ENGINE_VIDEO_FFMPEG_H_
#define LITAGS_ENGINE_VIDEO_FFMPEG_H_

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/mem.h>
#include <libswscale/swscale.h>
}

#include <memory>

namespace litags {

struct AvCloser {
  void operator()(AVIOContext* io) const {
    av_freep(&io->buffer);
    avio_context_free(&io);
  }
  void operator()(AVFormatContext* format) const {
    if (format->iformat != nullptr) return avformat_close_input(&format);
    avformat_free_context(format);
  }
  void operator()(AVCodecContext* codec) const { avcodec_free_context(&codec); }
  void operator()(AVFrame* frame) const { av_frame_free(&frame); }
  void operator()(AVPacket* packet) const { av_packet_free(&packet); }
  void operator()(SwsContext* scaler) const { sws_freeContext(scaler); }
};
template <class T>
using AvOwned = std::unique_ptr<T, AvCloser>;

}  // namespace litags

#endif  // LITAGS_ENGINE_VIDEO_FFMPEG_H_
