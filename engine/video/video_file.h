// Videos (from anybody), frame by frame.
#ifndef LITAGS_ENGINE_VIDEO_VIDEO_FILE_H_
#define LITAGS_ENGINE_VIDEO_VIDEO_FILE_H_

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "engine/core/camera.h"
#include "engine/core/image.h"
#include "engine/core/photo.h"

namespace litags {

// What a video may cost us.
struct VideoLimits {
  double max_seconds = 20 * 60;          // as it says, and as its frames come
  int64_t max_frames = 20 * 60 * 60;     // 60 a second
  int64_t max_pixels = kMaxImagePixels;  // of a frame
  int max_side = kMaxImageSide;          // px
};

struct VideoInfo {
  int width = 0, height = 0;  // px of a frame, upright, with square pixels
  double seconds = 0;         // as the file says; 0: it does not
  int64_t frames = 0;         // as the file says; 0: it does not
  int bits = 8;               // of a channel
  bool panorama = false;      // a frame is all of the sphere, equirectangular
};

bool IsVideoName(std::string_view name);

// ".mp4 .mov ...": one that the name of a video must have.
std::string VideoEndings();

// INVALID_ARGUMENT (VIDEO_TOO_COSTLY): reading the video takes more of `what`, memory or time.
absl::Status VideoTooCostly(const std::string& field, const char* what);

// By its first bytes: of a container that is read. Photos of HEIC and AVIF are none.
bool IsVideo(std::string_view bytes);

// Reads MP4, MOV, Matroska, WebM, AVI and MPEG-TS with H.264, HEVC, AV1, VP8, VP9, MPEG-2, MPEG-4,
// Motion JPEG or ProRes. Errors are INVALID_ARGUMENT, start with `field`, and carry one of
// these reasons: VIDEO_NOT_RECOGNIZED, VIDEO_CORRUPT (ends before its table of contents, or cannot
// be decoded), VIDEO_WITHOUT_PICTURES (sound only), VIDEO_UNSUPPORTED (codec, PQ, interlaced, parts
// of a sphere; by name), VIDEO_TOO_LARGE (a frame), VIDEO_TOO_LONG, VIDEO_TOO_COSTLY (there is no
// memory for it). Not thread-safe.
class VideoFile {
 public:
  // `bytes` must outlive the file.
  static absl::StatusOr<std::unique_ptr<VideoFile>> Open(std::string_view bytes,
                                                         const std::string& field,
                                                         const VideoLimits& limits = {});
  virtual ~VideoFile() = default;

  virtual const VideoInfo& info() const = 0;

  // Goes on to the next frame that is whole; false behind the last one.
  virtual absl::StatusOr<bool> Next() = 0;

  // How many frames that are damaged it has passed over so far.
  virtual int64_t DamagedFrames() const = 0;

  // Behind the last frame: how long a file should last whose end is missing; else 0.
  virtual double WholeSeconds() const = 0;

  // Of the frame that Next() came to.
  virtual double Seconds() const = 0;  // since the first
  // Its luma, not turned upright; 0: black, 1: white. The longer side has `side` px, or what it
  // has.
  virtual Planes Luma(int side) const = 0;
  // Upright, square pixels, sRGB; what lies below black stays there.
  virtual Photo Picture() const = 0;
};

// A look at the head: what it is, and that its first kMinPhotos frames can be decoded. Errors as
// above; TOO_FEW_FRAMES if it has fewer.
absl::StatusOr<VideoInfo> CheckVideo(std::string_view bytes, const std::string& field);

}  // namespace litags

#endif  // LITAGS_ENGINE_VIDEO_VIDEO_FILE_H_
