// Limits that both the engine and the service apply. Each is stated here once, so that the service
// refuses at the upload or at StartJob, where the user still is, what the engine would refuse
// later.
#ifndef LITAGS_ENGINE_CORE_LIMITS_H_
#define LITAGS_ENGINE_CORE_LIMITS_H_

#include <cstddef>
#include <cstdint>

#include "absl/status/status.h"

namespace litags {

inline constexpr size_t kMinPhotos = 3;  // two do not make a scene

inline constexpr int64_t kMaxImageBytes = int64_t{256} << 20;   // a photo, mask or depth map
inline constexpr int64_t kMaxVideoBytes = int64_t{4} << 30;     // 20 minutes at 27 Mbit/s
inline constexpr int64_t kMaxCamerasBytes = int64_t{16} << 20;  // some 30,000 frames
inline constexpr int64_t kMaxJobBytes = int64_t{16} << 30;      // all files of a job

// OK, or FAILED_PRECONDITION (TOO_FEW_PHOTOS) if fewer than kMinPhotos of `photos` are `usable`:
// have a camera and show something. Before that is known, all are usable.
absl::Status CheckPhotoCount(size_t usable, size_t photos);

}  // namespace litags

#endif  // LITAGS_ENGINE_CORE_LIMITS_H_
