// From files to photos with cameras, as training sees them.
#ifndef LITAGS_ENGINE_PIPELINE_LOAD_VIEWS_H_
#define LITAGS_ENGINE_PIPELINE_LOAD_VIEWS_H_

#include <vector>

#include "absl/status/statusor.h"
#include "engine/io/mask_io.h"
#include "engine/io/sparse_model.h"
#include "engine/pipeline/context.h"
#include "engine/train/train_view.h"

namespace litags {

struct LoadedViews {
  std::vector<TrainView> views;
  std::vector<int> model_view;  // index into the model's views, per view here
};

// Photos and masks as their pinhole cameras see them, shrunk to max_image_side. With Tone::kCapture
// the colours of deep shadow are inferred first, on the codes as the camera wrote them
// (shadow_color.h). Flat photos are left out, with a note. FAILED_PRECONDITION (TOO_FEW_PHOTOS) if
// fewer than kMinPhotos remain.
absl::StatusOr<LoadedViews> LoadViews(const Context& context, const SparseModel& model,
                                      const MaskPaths& masks);

}  // namespace litags

#endif  // LITAGS_ENGINE_PIPELINE_LOAD_VIEWS_H_
