// What of a folder of photos is of use: each is decoded once, before cameras are found.
#ifndef LITAGS_ENGINE_PIPELINE_PHOTO_SCREEN_H_
#define LITAGS_ENGINE_PIPELINE_PHOTO_SCREEN_H_

#include <functional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "engine/core/cancel.h"
#include "engine/io/mask_io.h"
#include "engine/pipeline/cut_input.h"
#include "engine/pipeline/photo_look.h"

namespace litags {

// The photos of a folder, by name, without the masks among them, and the masks that are given:
// those of masks_dir, else of the cameras' mask_path, else beside the photos.
struct PhotoList {
  std::vector<std::string> names;
  MaskPaths masks;
  std::vector<std::string> notes;
};
// Errors of ListPhotos, FindMasks and ReadImage of a mask.
absl::StatusOr<PhotoList> ListPhotosAndMasks(const ReconstructInput& input);

struct PhotoLeftOut {
  std::string name;
  std::string why;          // "is left out: ..."
  bool unreadable = false;  // a damaged file, or of a kind that is not read
};

struct PhotoScreen {
  std::vector<std::string> Names() const;

  std::vector<ScreenedPhoto> photos;  // to be used, by name
  std::vector<PhotoLeftOut> left_out;
  MaskPaths masks;                 // given ones, those of the cameras' file, and those found
  std::vector<std::string> notes;  // of all this, one a line
};

// Those of these files that are no masks of others by their names, such as 0001_mask.png.
std::vector<std::string> PhotosAmong(const std::vector<std::string>& names);

// As CheckPhotoCount() of so many photos that are used; says why the first of the others is not.
absl::Status CheckPhotosLeft(size_t used, absl::Span<const PhotoLeftOut> left_out);

// Leaves out, each by name: what cannot be decoded; photos that WhyLeftOut() has a reason for.
// Masks: those of ListPhotosAndMasks, whose errors it has; alpha channels and black bars that all
// photos of a size have are added, as new masks in work_dir/found_masks. Errors of ReadMask, of a
// photo that is used; CANCELLED. `progress` gets how many are read, now and then.
absl::StatusOr<PhotoScreen> ScreenPhotos(
    const CutInput& input, int threads, const CancelToken& cancel,
    const std::function<void(const std::string&)>& progress = nullptr);

}  // namespace litags

#endif  // LITAGS_ENGINE_PIPELINE_PHOTO_SCREEN_H_
