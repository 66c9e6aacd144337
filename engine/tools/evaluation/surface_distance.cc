#include "engine/tools/evaluation/surface_distance.h"

#include <Eigen/Dense>
#include <algorithm>
#include <opencv2/flann.hpp>

namespace litags {
namespace {

using Eigen::Vector3d;

constexpr int kNearest = 4;

Vector3d VectorOf(const std::array<double, 3>& p) { return {p[0], p[1], p[2]}; }

double DistanceToSegment(const Vector3d& p, const Vector3d& a, const Vector3d& b) {
  const double squared = (b - a).squaredNorm();
  const double share = squared > 0 ? std::clamp((p - a).dot(b - a) / squared, 0.0, 1.0) : 0;
  return (p - a - share * (b - a)).norm();
}

// The triangles at each vertex: those of vertex v are from first[v] to first[v + 1].
struct Fans {
  explicit Fans(const TriangleMesh& mesh) : first(mesh.vertices.size() + 1) {
    for (const auto& triangle : mesh.triangles) {
      for (const uint32_t corner : triangle) ++first[corner + 1];
    }
    for (size_t v = 0; v + 1 < first.size(); ++v) first[v + 1] += first[v];
    triangles.resize(3 * mesh.triangles.size());
    std::vector<uint32_t> next(first.begin(), first.end() - 1);
    for (uint32_t t = 0; t < mesh.triangles.size(); ++t) {
      for (const uint32_t corner : mesh.triangles[t]) triangles[next[corner]++] = t;
    }
  }

  std::vector<uint32_t> first, triangles;
};

// Relative to `origin`, for floats.
cv::Mat_<float> Rows(const PointCloud& points, const std::array<double, 3>& origin) {
  cv::Mat_<float> rows(static_cast<int>(points.size()), 3);
  for (int i = 0; i < rows.rows; ++i) {
    for (int k = 0; k < 3; ++k) rows(i, k) = static_cast<float>(points[i].xyz[k] - origin[k]);
  }
  return rows;
}

double DistanceTo(const TriangleMesh& surface, const Fans& fans, uint32_t vertex,
                  const std::array<double, 3>& point) {
  const uint32_t begin = fans.first[vertex], end = fans.first[vertex + 1];
  double least = (VectorOf(surface.vertices[vertex].xyz) - VectorOf(point)).norm();
  for (uint32_t at = begin; at < end; ++at) {
    const auto& [a, b, c] = surface.triangles[fans.triangles[at]];
    least = std::min(least, DistanceToTriangle(point, surface.vertices[a].xyz,
                                               surface.vertices[b].xyz, surface.vertices[c].xyz));
  }
  return least;
}

}  // namespace

double DistanceToTriangle(const std::array<double, 3>& point, const std::array<double, 3>& a,
                          const std::array<double, 3>& b, const std::array<double, 3>& c) {
  const Vector3d p = VectorOf(point), A = VectorOf(a), B = VectorOf(b), C = VectorOf(c);
  const Vector3d normal = (B - A).cross(C - A);
  // On the inner side of all three edges, the point below p is in the triangle.
  if (normal.squaredNorm() > 0 && normal.cross(B - A).dot(p - A) >= 0 &&
      normal.cross(C - B).dot(p - B) >= 0 && normal.cross(A - C).dot(p - C) >= 0) {
    return std::abs(normal.normalized().dot(p - A));
  }
  return std::min(
      {DistanceToSegment(p, A, B), DistanceToSegment(p, B, C), DistanceToSegment(p, C, A)});
}

std::vector<NearestSurface> NearestOf(const PointCloud& points, const TriangleMesh& surface) {
  if (points.empty()) return {};
  const std::array<double, 3> origin = surface.vertices[0].xyz;
  const cv::Mat_<float> data = Rows(surface.vertices, origin), queries = Rows(points, origin);
  const int nearest = std::min(kNearest, data.rows);
  cv::flann::GenericIndex<cvflann::L2_Simple<float>> index(data,
                                                           cvflann::KDTreeSingleIndexParams());
  cv::Mat_<int> found(queries.rows, nearest);
  cv::Mat_<float> squared(queries.rows, nearest);
  index.knnSearch(queries, found, squared, nearest, cvflann::SearchParams(-1));
  const Fans fans(surface);
  std::vector<NearestSurface> out;
  for (int i = 0; i < queries.rows; ++i) {
    const auto vertex = static_cast<uint32_t>(found(i, 0));
    double least = DistanceTo(surface, fans, vertex, points[i].xyz);
    for (int k = 1; k < nearest; ++k) {
      const auto other = static_cast<uint32_t>(found(i, k));
      least = std::min(least, DistanceTo(surface, fans, other, points[i].xyz));
    }
    out.push_back({least, vertex});
  }
  return out;
}

}  // namespace litags
