// Panoramas and fisheyes among the photos: each becomes pinhole views.
#ifndef LITAGS_ENGINE_PIPELINE_WIDE_VIEWS_H_
#define LITAGS_ENGINE_PIPELINE_WIDE_VIEWS_H_

#include <functional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "engine/core/cancel.h"
#include "engine/pipeline/cut_input.h"

namespace litags {

// Where photos see more than a pinhole picture can show (wide_photos.h): `input` with
// work_dir/wide_views as images_dir, which holds the other photos and, of 0001.jpg, 0001_front.png
// (0001.jpg_front.png where there is a 0001.png or 0001_front.jpg, too) and the other views of
// engine/io/wide_lens.h, 16 bits. Their masks are cut likewise, and hide what the photo does not
// show; views of which less than a twentieth is left are not made. Given cameras become those of
// the views, with the points that came with them. Otherwise `input` as it is. Files that cannot be
// read are left to those who read photos. `progress` gets what is done, a line each time. Errors of
// FindWidePhotos, ListPhotosAndMasks, DecodeMask and CheckMaskSize; those of files that cannot be
// written; CANCELLED.
absl::StatusOr<CutInput> WithViewsOfWidePhotos(
    const CutInput& input, int threads, const CancelToken& cancel,
    const std::function<void(const std::string&)>& progress, std::vector<std::string>* notes);

}  // namespace litags

#endif  // LITAGS_ENGINE_PIPELINE_WIDE_VIEWS_H_
