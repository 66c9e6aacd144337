#ifndef LITAGS_ENGINE_TRAIN_TRAIN_VIEW_H_
#define LITAGS_ENGINE_TRAIN_TRAIN_VIEW_H_

#include <optional>

#include "engine/core/camera.h"
#include "engine/core/color.h"
#include "engine/core/photo.h"
#include "engine/depth/depth_provider.h"
#include "engine/io/sparse_model.h"
#include "engine/render/renderer.h"

namespace litags {

// One photo with everything that training compares with. 40 photos of 500x375 with their targets
// and structure maps are 98 MB.
struct TrainView {
  View view;
  Photo photo;          // I_in, of the camera's size; at the median exposure if its own differs
  double exposure = 1;  // before training only: light relative to the median photo's, > 0
  Lamp lamp;            // that it was taken by: photo and target show R times what it does
  Photo target;         // the normal-light pseudo-target (paper's modulated I_in), same size
  PlaneU8 structure;    // P, 0..255 for 0..1; empty: no structure loss
  PlaneU8 information;  // weight of each pixel, kInformationOne for 1; empty: all 1
  PlaneU8 mask;         // 0: does not count, kCounts: does (engine/core/mask.h); empty: all count
  std::optional<DepthMap> depth;
  Distortion distortion;  // before training only: of the photo as taken; here it has none
};

}  // namespace litags

#endif  // LITAGS_ENGINE_TRAIN_TRAIN_VIEW_H_
