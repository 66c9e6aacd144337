#include "engine/surface/surface_nets.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "engine/core/parallel.h"

namespace litags {
namespace {

using Point = std::array<double, 3>;
using Index = TsdfVolume::Index;

constexpr int kSide = TsdfVolume::kSide;

// A block and the 26 around it.
class Neighborhood {
 public:
  Neighborhood(const TsdfVolume& volume, size_t b) {
    const Index middle = volume.block(b);
    for (int i = 0; i < 27; ++i) {
      blocks_[i] = volume.FindBlock(
          {middle[0] + i % 3 - 1, middle[1] + i / 3 % 3 - 1, middle[2] + i / 9 - 1});
    }
  }

  // The block of a voxel counted from the middle block's first one, each of -kSide .. 2 kSide - 1,
  // and the voxel's place in it; {-1, 0} if there is no such block.
  std::pair<int64_t, int> Find(const Index& voxel) const {
    int block = 0, place = 0, stride = 1, place_stride = 1;
    for (int k = 0; k < 3; ++k) {
      const int shifted = voxel[k] + kSide;
      block += stride * (shifted / kSide);
      place += place_stride * (shifted % kSide);
      stride *= 3;
      place_stride *= kSide;
    }
    return {blocks_[block], place};
  }

 private:
  std::array<int64_t, 27> blocks_;
};

// One block's part of the mesh.
struct Part {
  PointCloud vertices;
  std::array<int32_t, TsdfVolume::kVoxels> vertex_of;  // of a cube, by its first voxel; -1: none
  std::vector<std::array<uint32_t, 3>> triangles;
};

class Mesher {
 public:
  Mesher(const TsdfVolume& volume, int pictures)
      : volume_(volume), pictures_(pictures), parts_(volume.num_blocks()) {}

  TriangleMesh Run(int threads) {
    ParallelFor(threads, parts_.size(), [&](size_t b, int) { AddVertices(b); });
    first_vertex_.assign(parts_.size() + 1, 0);
    for (size_t b = 0; b < parts_.size(); ++b) {
      first_vertex_[b + 1] = first_vertex_[b] + static_cast<uint32_t>(parts_[b].vertices.size());
    }
    ParallelFor(threads, parts_.size(), [&](size_t b, int) { AddTriangles(b); });
    TriangleMesh mesh;
    for (const Part& part : parts_) {
      mesh.vertices.insert(mesh.vertices.end(), part.vertices.begin(), part.vertices.end());
      mesh.triangles.insert(mesh.triangles.end(), part.triangles.begin(), part.triangles.end());
    }
    return mesh;
  }

 private:
  // Null unless the voxel counts.
  const Voxel* VoxelAt(const Neighborhood& around, const Index& voxel) const {
    const auto [b, place] = around.Find(voxel);
    if (b < 0) return nullptr;
    const Voxel& found = volume_.voxels(static_cast<size_t>(b))[place];
    return found.near >= pictures_ ? &found : nullptr;
  }

  void AddVertices(size_t b) {
    Part& part = parts_[b];
    part.vertex_of.fill(-1);
    const Neighborhood around(volume_, b);
    for (int i = 0; i < TsdfVolume::kVoxels; ++i) {
      const Index first = {i % kSide, i / kSide % kSide, i / (kSide * kSide)};
      ColoredPoint vertex;
      if (!VertexOf(around, volume_.block(b), first, &vertex)) continue;
      part.vertex_of[i] = static_cast<int32_t>(part.vertices.size());
      part.vertices.push_back(vertex);
    }
  }

  // False if the cube has no vertex, or one of its voxels does not count.
  bool VertexOf(const Neighborhood& around, const Index& block, const Index& first,
                ColoredPoint* vertex) const {
    std::array<const Voxel*, 8> corners;
    int inside = 0;
    for (int i = 0; i < 8; ++i) {
      corners[i] =
          VoxelAt(around, {first[0] + (i & 1), first[1] + (i >> 1 & 1), first[2] + (i >> 2)});
      if (corners[i] == nullptr) return false;
      inside += corners[i]->distance() < 0;
    }
    if (inside == 0 || inside == 8) return false;
    Point at = {}, rgb = {};
    int crossings = 0, near = 0;
    for (int i = 0; i < 8; ++i) {
      near += corners[i]->near;
      for (int k = 0; k < 3; ++k) rgb[k] += corners[i]->rgb_sum[k];
      for (int axis = 0; axis < 3; ++axis) {
        const int j = i | 1 << axis;
        if (j == i || (corners[i]->distance() < 0) == (corners[j]->distance() < 0)) continue;
        const double d = corners[i]->distance(), share = d / (d - corners[j]->distance());
        ++crossings;
        for (int k = 0; k < 3; ++k) at[k] += k == axis ? share : i >> k & 1;
      }
    }
    Index voxel;
    for (int k = 0; k < 3; ++k) voxel[k] = kSide * block[k] + first[k];
    if (!volume_.InBox(voxel) || !volume_.InBox({voxel[0] + 1, voxel[1] + 1, voxel[2] + 1})) {
      return false;
    }
    const Point corner = volume_.PointOf(voxel);
    for (int k = 0; k < 3; ++k) {
      vertex->xyz[k] = corner[k] + volume_.voxel_side() * at[k] / crossings;
      vertex->rgb[k] = static_cast<uint8_t>(std::lround(rgb[k] / near));
    }
    return true;
  }

  // The number of a cube's vertex in the whole mesh; false if it has none.
  bool VertexAt(const Neighborhood& around, const Index& cube, uint32_t* number) const {
    const auto [b, place] = around.Find(cube);
    if (b < 0 || parts_[b].vertex_of[place] < 0) return false;
    *number = first_vertex_[b] + static_cast<uint32_t>(parts_[b].vertex_of[place]);
    return true;
  }

  const Point& At(uint32_t number) const {
    const auto after = std::upper_bound(first_vertex_.begin(), first_vertex_.end(), number);
    const size_t b = static_cast<size_t>(after - first_vertex_.begin()) - 1;
    return parts_[b].vertices[number - first_vertex_[b]].xyz;
  }

  double SquaredDistance(uint32_t a, uint32_t b) const {
    double sum = 0;
    for (int k = 0; k < 3; ++k) sum += (At(a)[k] - At(b)[k]) * (At(a)[k] - At(b)[k]);
    return sum;
  }

  void AddTriangles(size_t b) {
    const Neighborhood around(volume_, b);
    for (int i = 0; i < TsdfVolume::kVoxels; ++i) {
      const Index first = {i % kSide, i / kSide % kSide, i / (kSide * kSide)};
      const Voxel* from = VoxelAt(around, first);
      if (from == nullptr) continue;
      for (int axis = 0; axis < 3; ++axis) {
        Index second = first;
        ++second[axis];
        const Voxel* to = VoxelAt(around, second);
        if (to == nullptr || (from->distance() < 0) == (to->distance() < 0)) continue;
        AddQuad(around, first, axis, /*faces_axis=*/from->distance() < 0, &parts_[b]);
      }
    }
  }

  // Two triangles between the four cubes around the edge from a voxel along an axis.
  void AddQuad(const Neighborhood& around, const Index& voxel, int axis, bool faces_axis,
               Part* part) const {
    const int u = (axis + 1) % 3, v = (axis + 2) % 3;
    std::array<uint32_t, 4> corner;
    for (int i = 0; i < 4; ++i) {  // counterclockwise as seen from where the axis points
      Index cube = voxel;
      cube[u] -= i == 0 || i == 3;
      cube[v] -= i < 2;
      if (!VertexAt(around, cube, &corner[i])) return;
    }
    if (!faces_axis) std::swap(corner[1], corner[3]);
    const auto& [p, q, r, s] = corner;
    if (SquaredDistance(p, r) <= SquaredDistance(q, s)) {
      part->triangles.push_back({p, q, r});
      part->triangles.push_back({p, r, s});
    } else {
      part->triangles.push_back({p, q, s});
      part->triangles.push_back({q, r, s});
    }
  }

  const TsdfVolume& volume_;
  const int pictures_;
  std::vector<Part> parts_;
  std::vector<uint32_t> first_vertex_;  // of each block
};

}  // namespace

TriangleMesh SurfaceNets(const TsdfVolume& volume, int pictures, int threads) {
  return Mesher(volume, pictures).Run(threads);
}

}  // namespace litags
