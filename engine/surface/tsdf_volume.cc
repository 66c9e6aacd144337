#include "engine/surface/tsdf_volume.h"

#include <algorithm>
#include <cmath>

#include "engine/core/check.h"
#include "engine/core/error.h"
#include "engine/core/parallel.h"
#include "engine/surface/grid.h"

namespace litags {
namespace {

using Point = std::array<double, 3>;

// Widest pixel that a surface is taken from, in voxels. Choice: half a block, so that no block
// between two pixels is left out.
constexpr double kWidestPixel = TsdfVolume::kSide / 2.0;

// Least FacingOf a surface that is taken. Choice: over one pixel, the depth of a flatter one
// changes by more than ten times the pixel's width.
constexpr float kLeastFacing = 0.1f;

// Whether a ball, its centre in the camera's frame, may be in the picture.
bool MaySee(const Camera& camera, const Point& center, double radius) {
  const auto& [x, y, z] = center;
  if (z + radius <= 0) return false;
  const double nearest = z - radius;
  if (nearest <= 0) return true;
  const double rx = camera.fx * radius * (1 + std::abs(x) / z) / nearest,
               ry = camera.fy * radius * (1 + std::abs(y) / z) / nearest;
  const auto [u, v] = camera.Project(center);
  return u + rx > 0 && u - rx < camera.width && v + ry > 0 && v - ry < camera.height;
}

}  // namespace

TsdfVolume::Index TsdfVolume::block(size_t b) const { return CubeOfNumber(blocks_[b]); }

int64_t TsdfVolume::FindBlock(const Index& block) const {
  const uint64_t number = CubeNumber(block);
  const auto at = std::lower_bound(blocks_.begin(), blocks_.end(), number);
  return at != blocks_.end() && *at == number ? at - blocks_.begin() : -1;
}

Point TsdfVolume::PointOf(const Index& voxel) const {
  Point point;
  for (int k = 0; k < 3; ++k) point[k] = options_.center[k] + side_ * (voxel[k] + 0.5);
  return point;
}

// Appends the blocks that the ray through a known pixel passes within the truncation of its
// surface.
void TsdfVolume::AddBlocksAlong(const SurfacePicture& picture, int x, int y, float facing,
                                std::vector<uint64_t>* found) const {
  const Point point = picture.PointAt(x, y), eye = picture.camera.Center();
  if (options_.box.has_value() && !options_.box->Holds(point)) return;
  const double depth = picture.depth.at(0, y, x);
  const int steps = static_cast<int>(std::ceil(TruncationAt(depth) / (facing * side_)));
  for (int step = -steps; step <= steps; ++step) {
    const double along = step * side_ / depth;  // of the way from the camera to the surface
    Index block;
    for (int k = 0; k < 3; ++k) {
      const double at = point[k] + along * (point[k] - eye[k]) - options_.center[k];
      block[k] = static_cast<int32_t>(
          std::clamp(std::floor(at / (kSide * side_)), double(-kCubesAside), double(kCubesAside)));
    }
    const uint64_t number = CubeNumber(block);
    if (found->empty() || found->back() != number) found->push_back(number);
  }
}

std::vector<uint64_t> TsdfVolume::BlocksNear(const Input& input) const {
  const SurfacePicture& picture = *input.picture;
  std::vector<uint64_t> found;
  for (int y = 0; y < picture.camera.height; ++y) {
    for (int x = 0; x < picture.camera.width; ++x) {
      const float facing = input.facing.at(0, y, x);
      if (picture.Knows(x, y) && facing >= kLeastFacing &&
          picture.WidthAt(x, y) <= kWidestPixel * side_) {
        AddBlocksAlong(picture, x, y, facing, &found);
      }
    }
  }
  std::sort(found.begin(), found.end());
  found.erase(std::unique(found.begin(), found.end()), found.end());
  return found;
}

absl::Status TsdfVolume::FindBlocks(const std::vector<Input>& inputs) {
  const size_t most = std::max<size_t>(8, options_.most_bytes / (kVoxels * sizeof(Voxel)));
  while (true) {
    std::vector<std::vector<uint64_t>> found(inputs.size());
    ParallelFor(options_.threads, inputs.size(), [&](size_t i, int) {
      if (!options_.cancel.IsCancelled()) found[i] = BlocksNear(inputs[i]);
    });
    LITAGS_RETURN_IF_ERROR(options_.cancel.Check());
    blocks_.clear();
    for (const std::vector<uint64_t>& of_picture : found) {
      const auto middle = blocks_.insert(blocks_.end(), of_picture.begin(), of_picture.end());
      std::inplace_merge(blocks_.begin(), middle, blocks_.end());
      blocks_.erase(std::unique(blocks_.begin(), blocks_.end()), blocks_.end());
    }
    if (blocks_.size() <= most) return absl::OkStatus();
    // Blocks of a surface grow fewer with the square of their side.
    side_ *= std::max(1.05, std::sqrt(double(blocks_.size()) / most));
  }
}

// Adds what a picture says about the point of a voxel, `p` in the camera's frame.
void TsdfVolume::Observe(const Input& input, const Point& p, Voxel* voxel) const {
  const SurfacePicture& picture = *input.picture;
  const Camera& camera = picture.camera;
  if (!(p[2] > 0)) return;
  const auto [u, v] = camera.Project(p);
  if (!(u >= 0 && v >= 0 && u < camera.width && v < camera.height)) return;
  const int x = static_cast<int>(u), y = static_cast<int>(v);
  const float depth = picture.depth.at(0, y, x), facing = input.facing.at(0, y, x);
  if (!(depth > 0) || facing < kLeastFacing) return;
  const double far = TruncationAt(depth);
  double distance = facing * (depth - p[2]);
  // Most voxels are far from most pictures' surfaces: for them a pixel's own depth will do.
  if (std::abs(distance) < 2 * far) distance = facing * (DepthAt(picture, u, v) - p[2]);
  if (distance < -far) return;
  voxel->distance_sum += static_cast<float>(std::min(distance, far));
  ++voxel->seen;
  if (distance > far) return;
  ++voxel->near;
  const uint8_t* rgb = picture.color.pixel(x, y);
  for (int c = 0; c < 3; ++c) voxel->rgb_sum[c] += rgb[c];
}

void TsdfVolume::Add(const Input& input, size_t b) {
  const Camera& camera = input.picture->camera;
  const Index first = block(b);
  const Point corner =
      camera.CamFromWorld(PointOf({first[0] * kSide, first[1] * kSide, first[2] * kSide}));
  // Voxel (x, y, z) of the block, in the camera's frame.
  const auto at = [&](double x, double y, double z) {
    Point p = corner;
    for (size_t row = 0; row < 3; ++row) {
      const double* r = &camera.R[3 * row];
      p[row] += side_ * (x * r[0] + y * r[1] + z * r[2]);
    }
    return p;
  };
  constexpr double kHalf = (kSide - 1) / 2.0;
  if (!MaySee(camera, at(kHalf, kHalf, kHalf), std::sqrt(3.0) * kHalf * side_)) return;
  Voxel* voxel = &voxels_[b * kVoxels];
  for (int i = 0; i < kVoxels; ++i, ++voxel) {
    const int y = i / kSide % kSide, z = i / (kSide * kSide);
    Observe(input, at(i % kSide, y, z), voxel);
  }
}

absl::Status TsdfVolume::Fuse(const std::vector<SurfacePicture>& pictures,
                              const TsdfOptions& options) {
  LITAGS_CHECK(pictures.size() <= kMostPictures);
  options_ = options;
  blocks_.clear();
  voxels_.clear();
  median_ = MedianPixelOf(pictures, options.box);
  agreement_ = DepthAgreement(pictures);
  side_ = kCubePixels * median_.width;
  if (!(side_ > 0)) return absl::OkStatus();
  std::vector<Input> inputs;
  inputs.reserve(pictures.size());
  for (const SurfacePicture& picture : pictures) inputs.push_back({&picture, FacingOf(picture)});
  LITAGS_RETURN_IF_ERROR(FindBlocks(inputs));
  voxels_.resize(blocks_.size() * kVoxels);
  ParallelFor(options.threads, blocks_.size(), [&](size_t b, int) {
    if (options_.cancel.IsCancelled()) return;
    for (const Input& input : inputs) Add(input, b);
  });
  return options_.cancel.Check();
}

}  // namespace litags
