#ifndef LITAGS_CLIENT_FILM_H_
#define LITAGS_CLIENT_FILM_H_

#include <sys/types.h>

#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "client/picture_file.h"

namespace litags::client {

// A video that the program litags-film writes: encoders are no part of this one. What litags-film
// has to say it writes to stderr.
class Film {
 public:
  Film() = default;
  Film(const Film&) = delete;
  Film& operator=(const Film&) = delete;
  // Without Finish() no video is left behind.
  ~Film();

  // `path` ends with .webm or .mp4. FAILED_PRECONDITION (VIDEO_PROGRAM_MISSING), INVALID_ARGUMENT
  // (VIDEO_FAILED) if litags-film refuses it; errors of OutputFile, Finish() too.
  absl::Status Start(const std::string& path, int frames_per_second);
  // The next frame, a PNG or JPEG. INVALID_ARGUMENT (VIDEO_FAILED) once litags-film has given up;
  // Finish() likewise.
  absl::Status Add(std::string_view picture);
  absl::Status Finish();
  // Whether litags-film itself has told the user why there is no video.
  bool said_why() const { return said_why_; }

 private:
  // Waits until litags-film says that pictures can come; false if it says nothing.
  bool IsReady();
  // Closes its input, waits for its end, and returns its exit code.
  int End();
  absl::Status Failed();
  bool Send(std::string_view bytes);

  std::string path_;
  OutputFile file_{"--video"};
  pid_t pid_ = -1;
  bool said_why_ = false;
  int input_ = -1;  // our end of its standard input and output
};

}  // namespace litags::client

#endif  // LITAGS_CLIENT_FILM_H_
