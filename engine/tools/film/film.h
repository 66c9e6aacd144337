#ifndef LITAGS_ENGINE_TOOLS_FILM_FILM_H_
#define LITAGS_ENGINE_TOOLS_FILM_FILM_H_

#include <cstdio>
#include <string>

#include "absl/status/status.h"

namespace litags {

inline constexpr char kFilmReady[] = "ready";

// Writes a video of the pictures that come from `in`: each is a line with its length in bytes, then
// the bytes of a PNG or JPEG; a line "0" ends them. Writes the line kFilmReady to `out` once
// pictures can come. Errors of VideoWriter and of DecodeImage; CANCELLED (VIDEO_CUT_SHORT) if `in`
// ends before that line; INVALID_ARGUMENT (VIDEO_INPUT_INVALID) without a `video`, which is closed.
absl::Status WriteFilm(std::FILE* in, std::FILE* out, std::FILE* video, const std::string& path,
                       int frames_per_second);

}  // namespace litags

#endif  // LITAGS_ENGINE_TOOLS_FILM_FILM_H_
