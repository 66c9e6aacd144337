// Pictures as a video file: VP9 in WebM, H.264 in MP4.
#ifndef LITAGS_ENGINE_TOOLS_FILM_VIDEO_WRITER_H_
#define LITAGS_ENGINE_TOOLS_FILM_VIDEO_WRITER_H_

#include <cstdio>
#include <memory>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "engine/core/image.h"

namespace litags {

// Writes a video: BT.709, 8 bits, 4:2:0. Not thread-safe; encoders have threads of their own.
class VideoWriter {
 public:
  // By the ending of `path`: .webm or .mp4. `file`: that of this name, empty; it is closed at the
  // end. `field` names the option in errors. INVALID_ARGUMENT (VIDEO_FORMAT_UNKNOWN): another
  // ending; FAILED_PRECONDITION (VIDEO_ENCODER_MISSING): FFmpeg's libraries here have no encoder
  // for it.
  static absl::StatusOr<std::unique_ptr<VideoWriter>> Create(std::FILE* file,
                                                             const std::string& path,
                                                             int frames_per_second,
                                                             const std::string& field);
  virtual ~VideoWriter() = default;

  // The next frame. All have the size of the first; of odd sides the last row or column is left
  // out, as 4:2:0 has pairs of them. INVALID_ARGUMENT (VIDEO_SIZE_CHANGED, VIDEO_SIZE_INVALID),
  // RESOURCE_EXHAUSTED (OUTPUT_DISK_FULL), DATA_LOSS (OUTPUT_FAILED).
  virtual absl::Status Add(const ImageU8& picture) = 0;

  // INVALID_ARGUMENT (VIDEO_WITHOUT_PICTURES) without a frame.
  virtual absl::Status Finish() = 0;
};

}  // namespace litags

#endif  // LITAGS_ENGINE_TOOLS_FILM_VIDEO_WRITER_H_
