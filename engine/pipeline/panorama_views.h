// Panoramas among the photos: each becomes six pinhole views.
#ifndef LITAGS_ENGINE_PIPELINE_PANORAMA_VIEWS_H_
#define LITAGS_ENGINE_PIPELINE_PANORAMA_VIEWS_H_

#include <functional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "engine/core/cancel.h"
#include "engine/pipeline/engine.h"

namespace litags {

// Where photos are equirectangular panoramas (twice as wide as high, and their metadata or their
// edges say so) and no cameras are given: `input` with work_dir/panorama_views as images_dir, which
// holds the other photos and, of 0001.jpg, 0001_front.png (0001.jpg_front.png where there is a
// 0001.png, too) and the other views of
// engine/io/panorama.h, 16 bits. Masks of panoramas are cut likewise. Otherwise `input` as it is.
// Files that cannot be read are left to those who read photos. `progress` gets what is done, a line
// each time. Errors of FindMasks, DecodeMask and CheckMaskSize; those of files that cannot be
// written; CANCELLED.
absl::StatusOr<ReconstructInput> WithViewsOfPanoramas(
    const ReconstructInput& input, int threads, const CancelToken& cancel,
    const std::function<void(const std::string&)>& progress, std::vector<std::string>* notes);

}  // namespace litags

#endif  // LITAGS_ENGINE_PIPELINE_PANORAMA_VIEWS_H_
