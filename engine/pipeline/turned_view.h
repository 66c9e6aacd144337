// Given cameras of wide photos as those of their views.
#ifndef LITAGS_ENGINE_PIPELINE_TURNED_VIEW_H_
#define LITAGS_ENGINE_PIPELINE_TURNED_VIEW_H_

#include <vector>

#include "engine/core/camera.h"
#include "engine/io/sparse_model.h"
#include "engine/io/wide_lens.h"
#include "engine/pipeline/wide_photos.h"

namespace litags {

// The camera of a view of this side, px, cut out of a photo of `camera`.
Camera TurnedView(const Camera& camera, const CubeView& view, int side);

struct ViewOfPhoto {
  View view;
  int camera = 0;  // of its photo, index into WidePhotos::cameras.views
};

// The given cameras, by name, with those of `views` in place of the wide photos'. A point that a
// wide photo saw is seen by the view that it falls into, where it falls.
SparseModel CamerasOfViews(const WidePhotos& wide, const std::vector<ViewOfPhoto>& views);

}  // namespace litags

#endif  // LITAGS_ENGINE_PIPELINE_TURNED_VIEW_H_
