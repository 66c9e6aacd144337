// Depth pictures fused into a truncated signed distance function (TSDF) on a grid of voxels.
// Source: Curless and Levoy, "A Volumetric Method for Building Complex Models from Range Images",
// SIGGRAPH 1996, Sec. 3; blocks of voxels near surfaces only: Niessner et al., "Real-time 3D
// Reconstruction at Scale using Voxel Hashing", 2013, Sec. 3.
#ifndef LITAGS_ENGINE_SURFACE_TSDF_VOLUME_H_
#define LITAGS_ENGINE_SURFACE_TSDF_VOLUME_H_

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "absl/status/status.h"
#include "engine/core/cancel.h"
#include "engine/export/export_request.h"
#include "engine/surface/surface_picture.h"

namespace litags {

// Sums over the pictures that see the voxel's centre. 12 bytes: there are millions.
struct Voxel {
  float distance_sum = 0;  // from the surface, scene units, at most the truncation; positive on the
                           // camera's side of it
  std::array<uint16_t, 3> rgb_sum = {};  // of the `near` pictures
  uint8_t seen = 0;                      // pictures that do not see a surface far before it
  uint8_t near = 0;                      // those whose surface is within the truncation

  float distance() const { return distance_sum / seen; }  // seen > 0
};

struct TsdfOptions {
  std::array<double, 3> center = {};  // where voxels are counted from, world
  // Memory for voxels, bytes. Where it does not do, voxels become larger.
  size_t most_bytes = size_t{256} << 20;
  std::optional<Box> box;  // only surfaces in here
  int threads = 0;         // <= 0: all cores; the result does not depend on it
  CancelToken cancel;
};

class TsdfVolume {
 public:
  static constexpr int kSide = 8;  // voxels of a block along an axis
  static constexpr int kVoxels = kSide * kSide * kSide;
  using Index = std::array<int32_t, 3>;  // of a block or a voxel, counted from the centre

  // Voxel counts pictures in bytes.
  static constexpr size_t kMostPictures = 255;
  // Fuses at most kMostPictures; all of them have the same say. CANCELLED leaves it unfinished.
  absl::Status Fuse(const std::vector<SurfacePicture>& pictures, const TsdfOptions& options);

  size_t num_blocks() const { return blocks_.size(); }
  Index block(size_t b) const;  // its first voxel is kSide times this
  // -1 if there is no such block.
  int64_t FindBlock(const Index& block) const;
  // kVoxels of a block; x runs fastest, then y.
  const Voxel* voxels(size_t b) const { return &voxels_[b * kVoxels]; }
  double voxel_side() const { return side_; }  // scene units
  // A picture says something as far before and behind its surface, scene units, as pictures
  // disagree about the depth there (DepthAgreement), at least so many voxels. Choice: one for the
  // zero crossing, one for the slope.
  static constexpr double kLeastTruncation = 2;
  double TruncationAt(double depth) const {
    return std::max(kLeastTruncation * side_, agreement_ * depth);
  }
  double median_truncation() const { return TruncationAt(median_.depth); }
  // World coordinates of a voxel's centre.
  std::array<double, 3> PointOf(const Index& voxel) const;
  bool InBox(const Index& voxel) const {
    return !options_.box.has_value() || options_.box->Holds(PointOf(voxel));
  }

 private:
  // A picture with its FacingOf.
  struct Input {
    const SurfacePicture* picture;
    Planes facing;
  };
  void AddBlocksAlong(const SurfacePicture& picture, int x, int y, float facing,
                      std::vector<uint64_t>* found) const;
  std::vector<uint64_t> BlocksNear(const Input& input) const;
  absl::Status FindBlocks(const std::vector<Input>& inputs);
  void Observe(const Input& input, const std::array<double, 3>& p, Voxel* voxel) const;
  void Add(const Input& input, size_t b);

  TsdfOptions options_;
  MedianPixel median_;
  double agreement_ = 0;  // of depths, a share of them
  double side_ = 0;
  std::vector<uint64_t> blocks_;  // their numbers, ascending
  std::vector<Voxel> voxels_;
};

}  // namespace litags

#endif  // LITAGS_ENGINE_SURFACE_TSDF_VOLUME_H_
