#include "engine/pipeline/shrink.h"

#include <algorithm>
#include <cmath>

#include "engine/io/image_io.h"
#include "engine/io/mask_io.h"

namespace litags {

void Shrink(int max_side, TrainView* v) {
  Camera& camera = v->view.camera;
  const int side = std::max(camera.width, camera.height);
  if (max_side <= 0 || side <= max_side) return;
  const double scale = double(max_side) / side;
  const int width = std::max(1, static_cast<int>(std::lround(camera.width * scale)));
  const int height = std::max(1, static_cast<int>(std::lround(camera.height * scale)));
  const auto resize = [&](const auto& image) { return ResizeArea(image, width, height); };
  v->photo = resize(v->photo);
  if (!v->target.empty()) v->target = resize(v->target);
  if (!v->mask.empty()) v->mask = ChangeMask(v->mask, resize);
  camera = camera.Scaled(width, height);
}

}  // namespace litags
