// A camera and a cloud for tests of the renderer.
#ifndef LITAGS_ENGINE_RENDER_RENDERER_TEST_UTIL_H_
#define LITAGS_ENGINE_RENDER_RENDERER_TEST_UTIL_H_

#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>

#include "engine/core/camera.h"
#include "engine/core/rng.h"
#include "engine/core/splats.h"

namespace litags {

inline Camera MakeCamera(int width, int height) {
  Camera camera;
  camera.width = width;
  camera.height = height;
  camera.fx = 0.9 * width;
  camera.fy = 1.1 * width;
  camera.cx = 0.45 * width;
  camera.cy = 0.55 * height;
  EXPECT_TRUE(camera.LookAt({0.3, -0.2, -4}, {0.1, 0, 0}, {0.1, -1, 0}).ok());
  return camera;
}

// A cloud around the origin: mixed sizes and shapes, some before, across and behind the camera.
inline Splats MakeSplats(size_t n, uint64_t seed) {
  const CounterRng rng(seed, 7);
  Splats splats(n);
  for (size_t i = 0; i < n; ++i) {
    uint64_t counter = i * 200;
    const auto normal = [&] { return rng.Normal(counter++); };
    for (int k = 0; k < 3; ++k) splats.at(i, kMean + k) = 0.8 * normal();
    if (i % 13 == 5) splats.at(i, kMean + 2) -= 4;  // near the camera, half of them behind it
    for (int k = 0; k < 3; ++k) splats.at(i, kLogScale + k) = -2.2 + 0.7 * normal();
    for (int k = 0; k < 4; ++k) splats.at(i, kRawQuat + k) = normal();
    splats.at(i, kLogitOpacity) = 1.5 * normal();
    for (int row = kShDc; row < kSplatRows; ++row) splats.at(i, row) = 0.4 * normal();
  }
  return splats;
}

}  // namespace litags

#endif  // LITAGS_ENGINE_RENDER_RENDERER_TEST_UTIL_H_
