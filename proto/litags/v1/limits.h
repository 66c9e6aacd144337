// What the service's interface says in comments only, as constants for client and server.
#ifndef LITAGS_PROTO_LITAGS_V1_LIMITS_H_
#define LITAGS_PROTO_LITAGS_V1_LIMITS_H_

#include <array>
#include <cstddef>
#include <string_view>

namespace litags::v1 {

inline constexpr int kMaxAnswerBytes = 256 << 20;  // raw floats of a 16-megapixel picture: 192 MiB
inline constexpr size_t kMaxChunkBytes = size_t{1} << 20;  // of an upload
inline constexpr int kMaxQueryFiles = 1000;                // QueryUploadRequest.files
inline constexpr size_t kMaxDisplayNameBytes = 200;

// How names of files end, lower case, by FileRole.
inline constexpr std::array<std::string_view, 24> kPhotoEndings = {
    ".jpg",  ".jpeg", ".jpe", ".jfif", ".png", ".tif", ".tiff", ".webp",
    ".heic", ".heif", ".hif", ".avif", ".jxl", ".dng", ".nef",  ".nrw",
    ".cr2",  ".cr3",  ".arw", ".raf",  ".orf", ".rw2", ".pef",  ".srw"};
inline constexpr std::array<std::string_view, 10> kVideoEndings = {
    ".mp4", ".mov", ".m4v", ".3gp", ".mkv", ".webm", ".avi", ".mts", ".m2ts", ".ts"};
inline constexpr std::array<std::string_view, 3> kDepthEndings = {".png", ".pfm", ".npy"};
inline constexpr std::array<std::string_view, 1> kMaskEndings = {".png"};
inline constexpr std::array<std::string_view, 4> kCamerasEndings = {".json", ".sfm", ".xml",
                                                                    ".out"};
inline constexpr std::array<std::string_view, 2> kColmapEndings = {".bin", ".txt"};
inline constexpr std::array<std::string_view, 4> kArchiveEndings = {".zip", ".tar", ".tar.gz",
                                                                    ".tgz"};
// How a scene's file ends, by number of ModelFormat; 0 is the default.
inline constexpr std::array<std::string_view, 17> kModelEndings = {
    ".ply",   ".ply",      ".ply",      ".spz",  ".spz",   ".compressed.ply",
    ".splat", ".glb",      ".usda",     ".sog",  ".zip",   ".points.ply",
    ".las",   ".mesh.ply", ".mesh.glb", ".html", ".litags"};

}  // namespace litags::v1

#endif  // LITAGS_PROTO_LITAGS_V1_LIMITS_H_
