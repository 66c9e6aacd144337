// The photos of a capture and the prepared copies that COLMAP sees.
#ifndef LITAGS_ENGINE_SFM_PHOTO_SET_H_
#define LITAGS_ENGINE_SFM_PHOTO_SET_H_

#include <functional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "engine/core/camera.h"
#include "engine/core/cancel.h"
#include "engine/core/image.h"
#include "engine/io/mask_io.h"
#include "engine/io/rig.h"
#include "engine/sfm/exposure.h"

namespace litags {

struct PhotoFile {
  std::string name;  // file name in the photos' folder
  // Shown size and EXIF focal length, "480x361_26mm": photos alike share a camera, also where the
  // focal lengths of one lens differ by a percent. Where EXIF names several cameras that would be
  // one by this, each has a number: "480x361_26mm_camera2".
  std::string camera;
  std::string copy_name;      // camera and number, "480x361/000003.png": COLMAP shares a camera per
                              // folder; no name of a client's choice reaches its command line or
                              // database
  int width = 0, height = 0;  // px, upright
  // The part that the copy shows, in the middle: less than all where photos of one lens differ in
  // size by a few px, so that their copies have one size.
  PixelRect shown;
  int copy_width = 0, copy_height = 0;  // px
  double copy_focal_length = 0;         // px, if it is known, else 0
  double copy_exif_focal_length = 0;    // px, as EXIF has it, which may be wrong; else 0
  std::string mask_path;                // empty: all pixels count
};

// The camera of a photo's copy, and of a photo by that of its copy.
Camera CameraOfCopy(const Camera& of_photo, const PhotoFile& photo);
Camera CameraOfPhoto(const Camera& of_copy, const PhotoFile& photo);

// All photos of a folder in name order, sized but not decoded. Copies have a longer side of at
// most max_image_side (0: no bound). `masks`: those of the photos that have one. Errors of
// ListPhotos and ReadImageSize.
// `rigs`: photos whose lens is known.
absl::StatusOr<std::vector<PhotoFile>> ListPhotoSet(const std::string& images_dir,
                                                    int max_image_side, const MaskPaths& masks = {},
                                                    const RigViews& rigs = {});

// Mean light of up to 32 photos spread evenly over the capture, without their masked pixels.
absl::StatusOr<LightStats> MeasureCapture(const std::string& images_dir,
                                          const std::vector<PhotoFile>& photos, int threads,
                                          const CancelToken& cancel);

// Writes the prepared copies under copies_dir, and for photos with a mask that of the copy, as
// masks_dir/<copy_name>.png: COLMAP finds no features where it is black. `progress` gets fractions,
// in the calling thread.
absl::Status WriteCopies(const std::string& images_dir, const std::vector<PhotoFile>& photos,
                         Preparation preparation, const std::string& copies_dir,
                         const std::string& masks_dir, int threads, const CancelToken& cancel,
                         const std::function<void(double)>& progress);

// Writes a file that is made anew after a crash, so without fsync. RESOURCE_EXHAUSTED DISK_FULL.
absl::Status WriteScratch(const std::string& path, const std::string& bytes);

}  // namespace litags

#endif  // LITAGS_ENGINE_SFM_PHOTO_SET_H_
