// A made-up scene for timing: the same bytes for the same arguments.
#ifndef LITAGS_ENGINE_TOOLS_BENCH_BENCH_SCENE_H_
#define LITAGS_ENGINE_TOOLS_BENCH_BENCH_SCENE_H_

#include <cstddef>

#include "engine/core/camera.h"
#include "engine/core/noise_curve.h"
#include "engine/core/splats.h"
#include "engine/train/train_view.h"

namespace litags {

// A camera at the origin looking along z.
Camera BenchCamera(int width, int height);

// `n` Gaussians on curved sheets in front of BenchCamera, nearly all in view. Sizes are such that a
// pixel is reached by about 40 of them whatever n is, as measured on densified scenes; shapes,
// opacities and colours are random.
Splats BenchSplats(size_t n, const Camera& camera);

// What the rounding of photos six stops too dark leaves in pictures.
NoiseCurve BenchNoise();

// A photo of noise and gradients with target and structure map, for the losses.
TrainView BenchView(const Camera& camera);

}  // namespace litags

#endif  // LITAGS_ENGINE_TOOLS_BENCH_BENCH_SCENE_H_
