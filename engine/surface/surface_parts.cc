#include "engine/surface/surface_parts.h"

#include <algorithm>
#include <numeric>
#include <vector>

#include "engine/export/export_request.h"

namespace litags {
namespace {

// Sets of vertices that triangles join; each is named by one of its vertices.
class VertexSets {
 public:
  explicit VertexSets(size_t vertices) : parent_(vertices) {
    std::iota(parent_.begin(), parent_.end(), 0u);
  }

  uint32_t Find(uint32_t vertex) {
    while (parent_[vertex] != vertex) {
      parent_[vertex] = parent_[parent_[vertex]];
      vertex = parent_[vertex];
    }
    return vertex;
  }

  void Join(uint32_t a, uint32_t b) { parent_[Find(a)] = Find(b); }

 private:
  std::vector<uint32_t> parent_;
};

void RemoveUnusedVertices(TriangleMesh* mesh) {
  constexpr uint32_t kUnused = ~0u;
  std::vector<uint32_t> number(mesh->vertices.size(), kUnused);
  for (const auto& triangle : mesh->triangles) {
    for (const uint32_t corner : triangle) number[corner] = 0;
  }
  uint32_t kept = 0;
  for (size_t i = 0; i < number.size(); ++i) {
    if (number[i] == kUnused) continue;
    mesh->vertices[kept] = mesh->vertices[i];
    number[i] = kept++;
  }
  mesh->vertices.resize(kept);
  for (auto& triangle : mesh->triangles) {
    for (uint32_t& corner : triangle) corner = number[corner];
  }
}

}  // namespace

void RemoveSmallParts(double longest, TriangleMesh* mesh) {
  VertexSets sets(mesh->vertices.size());
  for (const auto& [a, b, c] : mesh->triangles) {
    sets.Join(a, b);
    sets.Join(b, c);
  }
  std::vector<Box> boxes;
  for (const ColoredPoint& vertex : mesh->vertices) boxes.push_back({vertex.xyz, vertex.xyz});
  for (uint32_t i = 0; i < boxes.size(); ++i) {
    Box& box = boxes[sets.Find(i)];
    for (int k = 0; k < 3; ++k) {
      box.min[k] = std::min(box.min[k], mesh->vertices[i].xyz[k]);
      box.max[k] = std::max(box.max[k], mesh->vertices[i].xyz[k]);
    }
  }
  std::erase_if(mesh->triangles, [&](const auto& triangle) {
    return boxes[sets.Find(triangle[0])].LongestSide() <= longest;
  });
  RemoveUnusedVertices(mesh);
}

}  // namespace litags
