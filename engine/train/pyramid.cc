#include "engine/train/pyramid.h"

#include <algorithm>
#include <cmath>

#include "engine/core/check.h"
#include "engine/core/mask.h"
#include "engine/core/quantile.h"
#include "engine/core/splats.h"

namespace litags {
namespace {

constexpr int kMinSide = 64;

// Means of 2x2 interleaved samples, rounded half up.
template <class T>
std::vector<T> HalfSamples(const std::vector<T>& samples, int width, int height, int channels) {
  const int w = width / 2, h = height / 2;
  std::vector<T> out(size_t(w) * h * channels);
  for (int y = 0; y < h; ++y) {
    const T* top = samples.data() + size_t(2 * y) * width * channels;
    const T* bottom = top + size_t(width) * channels;
    T* to = out.data() + size_t(y) * w * channels;
    for (int x = 0; x < w; ++x) {
      for (int c = 0; c < channels; ++c) {
        const int i = 2 * x * channels + c, j = i + channels;
        to[x * channels + c] = static_cast<T>((top[i] + top[j] + bottom[i] + bottom[j] + 2) >> 2);
      }
    }
  }
  return out;
}

PlaneU8 HalfPlane(const PlaneU8& plane) {
  PlaneU8 out;
  if (plane.empty()) return out;
  out = PlaneU8(plane.width / 2, plane.height / 2);
  out.data = HalfSamples(plane.data, plane.width, plane.height, 1);
  return out;
}

DepthMap HalfDepth(const DepthMap& map) {
  const int w = map.depth.width / 2, h = map.depth.height / 2;
  DepthMap out;
  out.edge = map.edge;
  out.depth = Planes(1, h, w);
  if (!map.confidence.empty()) out.confidence = Planes(1, h, w);
  for (int y = 0; y < h; ++y) {
    for (int x = 0; x < w; ++x) {
      float sum = 0, weight = 0;
      for (int i = 0; i < 4; ++i) {
        const int sx = 2 * x + i % 2, sy = 2 * y + i / 2;
        const float known = map.confidence.empty() ? 1.0f : map.confidence.at(0, sy, sx);
        sum += known * map.depth.at(0, sy, sx);
        weight += known;
      }
      if (weight > 0) out.depth.at(0, y, x) = sum / weight;
      if (!map.confidence.empty()) out.confidence.at(0, y, x) = weight / 4;
    }
  }
  return out;
}

// Halvings, at most `most`, after which the shorter side still has kMinSide pixels.
int LevelsOf(const Camera& camera, int most) {
  int levels = 0;
  for (int side = std::min(camera.width, camera.height); side >= 2 * kMinSide; side /= 2) ++levels;
  return std::min(levels, most);
}

}  // namespace

Photo HalfPhoto(const Photo& photo) {
  Photo out(photo.width / 2, photo.height / 2);
  out.data = HalfSamples(photo.data, photo.width, photo.height, 3);
  return out;
}

PlaneU8 HalfMask(const PlaneU8& mask) {
  PlaneU8 out = HalfPlane(mask);
  for (uint8_t& counts : out.data) counts = counts == kCounts ? kCounts : 0;
  return out;
}

TrainView HalfSize(const TrainView& view) {
  TrainView out;
  out.view = view.view;
  Camera& camera = out.view.camera;
  camera.width /= 2;
  camera.height /= 2;
  for (double* v : {&camera.fx, &camera.fy, &camera.cx, &camera.cy}) *v /= 2;
  out.photo = HalfPhoto(view.photo);
  out.target = HalfPhoto(view.target);
  out.structure = HalfPlane(view.structure);
  out.information = HalfPlane(view.information);
  out.mask = HalfMask(view.mask);
  out.lamp = view.lamp;
  if (view.depth.has_value()) {
    const bool fine = view.depth->depth.width >= 2 * camera.width;
    out.depth = fine ? HalfDepth(*view.depth) : *view.depth;
  }
  return out;
}

int ShDegreeAt(const TrainOptions& options, int iteration) {
  return std::min(options.sh_degree, 1 + iteration / options.recipe.sh_interval);
}

namespace {

// A density step is due as they end: the first that may fill the budget of full size.
double CoarseIterations(const TrainOptions& options) {
  const double share = options.recipe.coarse_until * options.iterations;
  const double steps = std::floor(share / options.recipe.densify_every);
  return steps > 0 ? steps * options.recipe.densify_every : share;
}

}  // namespace

ViewPyramid::ViewPyramid(const std::vector<TrainView>* views, const TrainOptions& options)
    : views_(views), options_(options), coarse_iterations_(CoarseIterations(options)) {
  LITAGS_CHECK(!views->empty());
  std::vector<int> levels;
  for (const TrainView& v : *views) {
    levels.push_back(LevelsOf(v.view.camera, options.recipe.coarse_levels));
  }
  levels_ = MedianInPlace(levels);
  for (const TrainView& v : *views) {
    std::vector<TrainView>& smaller = smaller_.emplace_back();
    for (int level = 0; level < LevelsOf(v.view.camera, levels_); ++level) {
      smaller.push_back(HalfSize(level == 0 ? v : smaller.back()));
    }
  }
  for (int level = 0; level <= levels_; ++level) {
    const double whole = MeanPixels(level, 0);
    compared_.push_back(MeanPixels(level, options.recipe.crop_pixels));
    compared_share_.push_back(compared_.back() / whole);
    // Compared as doubles: int64_t may not hold the product.
    const double most = whole * options.recipe.coarse_gaussians;
    const bool fewer = level > 0 && most < static_cast<double>(options.max_gaussians);
    most_gaussians_.push_back(fewer ? static_cast<int64_t>(most) : options.max_gaussians);
  }
}

const TrainView& ViewPyramid::View(int level, size_t index) const {
  const std::vector<TrainView>& smaller = smaller_[index];
  level = std::min(level, static_cast<int>(smaller.size()));
  return level == 0 ? (*views_)[index] : smaller[level - 1];
}

double ViewPyramid::MeanPixels(int level, int64_t crop_pixels) const {
  double sum = 0;
  for (size_t i = 0; i < views_->size(); ++i) {
    const Photo& photo = View(level, i).photo;
    sum += static_cast<double>(photo.pixels()) /
           CropGrid(photo.width, photo.height, crop_pixels).cells();
  }
  return sum / static_cast<double>(views_->size());
}

int ViewPyramid::LevelOf(int iteration) const {
  if (iteration >= coarse_iterations_) return 0;
  return levels_ - static_cast<int>(iteration / coarse_iterations_ * levels_);
}

CropGrid ViewPyramid::GridOf(int iteration, size_t index) const {
  const Photo& photo = View(LevelOf(iteration), index).photo;
  return {photo.width, photo.height, options_.recipe.crop_pixels};
}

const TrainView& ViewPyramid::Compared(int iteration, size_t index, uint64_t visit,
                                       TrainView* cropped, PixelRect* crop) const {
  const TrainView& view = View(LevelOf(iteration), index);
  const CropGrid grid = GridOf(iteration, index);
  *crop = DrawCrop(grid, options_.seed, index, visit);
  if (grid.cells() == 1) return view;
  CropView(view, *crop, options_.threads, cropped);
  return *cropped;
}

int ViewPyramid::CoarseEnd() const {
  return levels_ == 0 ? 0 : static_cast<int>(std::ceil(coarse_iterations_));
}

double ViewPyramid::WorkOf(int iteration, double gaussians) const {
  const int level = LevelOf(iteration);
  const double rows = SplatRowsForDegree(ShDegreeAt(options_, iteration));
  return compared_[level] + kPixelsBeside +
         kPixelsOfGaussian * gaussians * compared_share_[level] * rows / double{kSplatRows};
}

int64_t ViewPyramid::MostGaussians(int level) const { return most_gaussians_[level]; }

}  // namespace litags
