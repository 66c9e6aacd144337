#include "engine/core/limits.h"

#include <string>

#include "absl/strings/str_cat.h"
#include "engine/core/counted.h"
#include "engine/core/error.h"

namespace litags {

absl::Status CheckPhotoCount(size_t usable, size_t photos) {
  if (usable >= kMinPhotos) return absl::OkStatus();
  const std::string found =
      usable == photos
          ? Counted(photos, "photo")
          : absl::StrCat(usable, " of ", photos, " photos have a camera and show something");
  return MakeError(absl::StatusCode::kFailedPrecondition, "TOO_FEW_PHOTOS", "images",
                   absl::StrCat("images: ", found, "; a scene needs at least ", kMinPhotos,
                                ", better 20 or more, of one place that overlap: add some"));
}

}  // namespace litags
