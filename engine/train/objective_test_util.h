// Views and renders for tests of the objective.
#ifndef LITAGS_ENGINE_TRAIN_OBJECTIVE_TEST_UTIL_H_
#define LITAGS_ENGINE_TRAIN_OBJECTIVE_TEST_UTIL_H_

#include <cstddef>
#include <cstdint>

#include "engine/train/loss_test_util.h"
#include "engine/train/train_test_util.h"
#include "engine/train/train_view.h"

namespace litags {

// Photo, target and structure are below 1.
inline TrainView RandomView(int width, int height) {
  TrainView view;
  view.view.camera = RingCamera(0, 1, width, height);
  view.photo = PhotoFromU8(ToImageU8(RandomPlanes(3, height, width, 1)));
  view.target = PhotoFromU8(ToImageU8(RandomPlanes(3, height, width, 5)));
  view.structure = PlaneU8(width, height);
  const Planes structure = RandomPlanes(1, height, width, 2);
  for (size_t i = 0; i < structure.data.size(); ++i) {
    view.structure.data[i] = static_cast<uint8_t>(255 * structure.data[i]);
  }
  view.depth = DepthMap{RandomPlanes(1, height, width, 3), RandomPlanes(1, height, width, 4)};
  return view;
}

// R in 1.7..2.2, L above 4.2, structure above 1.1: with RandomView no L1 term is within a step of
// its kink, so differences are smooth. Both signs of L1 are losses_test's to check.
inline Planes RenderedAwayFromKinks(int channels, int width, int height) {
  Planes rendered = RandomPlanes(channels, height, width, 9);
  for (int c = 0; c < channels; ++c) {
    for (size_t i = 0; i < rendered.plane_size(); ++i) {
      float& v = rendered.plane(c)[i];
      if (c < 3) v = 1.7f + 0.5f * v;
      if (c == kChannelStructure) v += 1.1f;
      if (c >= kChannelIllumination && c < kChannelIllumination + 3) v += 4.2f;
    }
  }
  return rendered;
}

}  // namespace litags

#endif  // LITAGS_ENGINE_TRAIN_OBJECTIVE_TEST_UTIL_H_
