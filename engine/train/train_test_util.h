// Helpers of the training tests: small scenes and views of them.
#ifndef LITAGS_ENGINE_TRAIN_TRAIN_TEST_UTIL_H_
#define LITAGS_ENGINE_TRAIN_TRAIN_TEST_UTIL_H_

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <string>
#include <vector>

#include "engine/core/rng.h"
#include "engine/core/splats.h"
#include "engine/render/renderer.h"
#include "engine/train/train_view.h"

namespace litags {

inline bool SameBytes(const AlignedFloats& a, const AlignedFloats& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(float)) == 0;
}

// A camera of a ring of `count`, two metres above a scene of size 1 and four away from it.
inline Camera RingCamera(int index, int count, int width, int height) {
  Camera camera;
  camera.width = width;
  camera.height = height;
  camera.fx = camera.fy = 1.1 * width;
  camera.cx = 0.5 * width;
  camera.cy = 0.5 * height;
  const double angle = 6.283185307179586 * index / count;
  EXPECT_TRUE(
      camera.LookAt({4 * std::cos(angle), -2, 4 * std::sin(angle)}, {0, 0, 0}, {0, -1, 0}).ok());
  return camera;
}

// `n` opaque, coloured Gaussians around the origin, with plausible LITA attributes.
inline Splats ColoredCloud(size_t n, uint64_t seed) {
  const CounterRng rng(seed, 3);
  Splats splats(n);
  for (size_t i = 0; i < n; ++i) {
    uint64_t counter = i * 64;
    const auto uniform = [&] { return rng.Uniform(counter++); };
    for (int k = 0; k < 3; ++k) splats.at(i, kMean + k) = static_cast<float>(2 * uniform() - 1);
    for (int k = 0; k < 3; ++k) {
      splats.at(i, kLogScale + k) = static_cast<float>(std::log(0.05 + 0.1 * uniform()));
    }
    for (int k = 0; k < 4; ++k) splats.at(i, kRawQuat + k) = static_cast<float>(uniform() - 0.5);
    splats.at(i, kLogitOpacity) = static_cast<float>(1 + uniform());
    for (int k = 0; k < 3; ++k) {
      splats.at(i, kShDc + k) = static_cast<float>(2.5 * (uniform() - 0.5));
    }
    splats.at(i, kDepth) = static_cast<float>(3 + uniform());
    splats.at(i, kStructure) = static_cast<float>(uniform());
    for (int k = 0; k < 3; ++k) splats.at(i, kNoise + k) = static_cast<float>(0.1 * uniform());
    for (int k = 0; k < 3; ++k) splats.at(i, kIllumination + k) = static_cast<float>(uniform());
  }
  return splats;
}

// Photos of `splats` at a third of their light from a ring of cameras, with targets of three times
// their codes, a structure map of made-up edges, and depth maps for every other view.
inline std::vector<TrainView> DarkViews(const Splats& splats, int count, int width, int height) {
  std::vector<TrainView> views(count);
  Renderer renderer;
  RenderSettings settings;
  settings.sh_degree = 0;
  settings.depth_source = DepthSource::kCameraZ;
  settings.threads = 1;
  Planes image, alpha;
  for (int v = 0; v < count; ++v) {
    TrainView& view = views[v];
    view.view.name = "photo" + std::to_string(v) + ".png";
    view.view.camera = RingCamera(v, count, width, height);
    renderer.Forward(splats, view.view.camera, settings, &image, &alpha);
    Planes dark(3, height, width);
    for (size_t i = 0; i < dark.data.size(); ++i) dark.data[i] = image.data[i] / 3;
    view.photo = PhotoFromU8(ToImageU8(dark));
    view.target = view.photo;
    for (int16_t& sample : view.target.data) {
      sample = static_cast<int16_t>(std::min(kPhotoWhite, 3 * sample));
    }
    view.structure = PlaneU8(width, height);
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        view.structure.data[size_t(y) * width + x] =
            static_cast<uint8_t>((7 * x + 13 * y + 31 * v) % 256);
      }
    }
    if (v % 2 == 0) {
      DepthMap depth;
      depth.depth = Planes(1, height, width);
      std::copy_n(image.plane(kChannelDepth), image.plane_size(), depth.depth.data.data());
      view.depth = std::move(depth);
    }
  }
  return views;
}

}  // namespace litags

#endif  // LITAGS_ENGINE_TRAIN_TRAIN_TEST_UTIL_H_
