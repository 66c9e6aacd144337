#include "engine/tools/bench/bench_scene.h"

#include <algorithm>
#include <cmath>

#include "engine/core/rng.h"
#include "engine/target/tone.h"
#include "engine/train/density.h"

namespace litags {

Camera BenchCamera(int width, int height) {
  Camera camera;
  camera.width = width;
  camera.height = height;
  camera.fx = camera.fy = 0.9 * width;
  camera.cx = 0.5 * width;
  camera.cy = 0.5 * height;
  return camera;
}

Splats BenchSplats(size_t n, const Camera& camera) {
  const CounterRng rng(1, 0xBE);
  Splats splats(n);
  // A Gaussian of deviation s px at opacity 1/2 reaches about 2 pi s^2 ln(127) = 30 s^2 px.
  const double pixels = double(camera.width) * camera.height;
  const double sigma_px = std::sqrt(40.0 * pixels / (30.0 * n));
  for (size_t i = 0; i < n; ++i) {
    uint64_t counter = i * 256;
    const auto uniform = [&] { return rng.Uniform(counter++); };
    const auto normal = [&] { return rng.Normal(counter++); };
    const double x = (1.1 * uniform() - 0.05) * camera.width;
    const double y = (1.1 * uniform() - 0.05) * camera.height;
    const double z =
        3 + 1.5 * std::sin(x * 0.013) * std::cos(y * 0.011) + (i % 3) * 0.7 + 0.05 * normal();
    splats.at(i, kMean) = static_cast<float>((x - camera.cx) / camera.fx * z);
    splats.at(i, kMean + 1) = static_cast<float>((y - camera.cy) / camera.fy * z);
    splats.at(i, kMean + 2) = static_cast<float>(z);
    const double base = std::log(sigma_px * z / camera.fx) - 0.3;
    for (int k = 0; k < 3; ++k)
      splats.at(i, kLogScale + k) = static_cast<float>(base + 0.5 * normal());
    for (int k = 0; k < 4; ++k) splats.at(i, kRawQuat + k) = static_cast<float>(normal());
    splats.at(i, kLogitOpacity) = static_cast<float>(1.5 * normal());
    for (int row = kShDc; row < kSplatRows; ++row)
      splats.at(i, row) = static_cast<float>(0.3 * normal());
    for (int k = 0; k < 3; ++k) splats.at(i, kIllumination + k) = 0.1f;
  }
  // In the order that the trainer keeps.
  const std::vector<uint32_t> order = MortonOrder(splats);
  Splats sorted(n);
  for (size_t i = 0; i < n; ++i) sorted.Copy(splats, order[i], i);
  return sorted;
}

NoiseCurve BenchNoise() { return RoundingNoise(ToneOptions(), 64); }

TrainView BenchView(const Camera& camera) {
  const CounterRng rng(1, 0xBF);
  TrainView view;
  view.view = {"bench.png", camera};
  view.photo = Photo(camera.width, camera.height);
  view.structure = PlaneU8(camera.width, camera.height);
  for (size_t i = 0; i < view.photo.data.size(); ++i) {
    const double x = double(i / 3 % camera.width) / camera.width;
    view.photo.data[i] = static_cast<int16_t>(
        kPhotoCode * std::clamp(20 + 15 * std::sin(20 * x) + 3 * rng.Normal(i), 0.0, 255.0));
  }
  for (size_t i = 0; i < view.structure.data.size(); ++i) {
    view.structure.data[i] = static_cast<uint8_t>(rng.Below(i, 256));
  }
  view.target = view.photo;
  for (int16_t& v : view.target.data) v = static_cast<int16_t>(std::min(kPhotoWhite, 8 * v));
  return view;
}

}  // namespace litags
