#include "engine/export/viewer_scene.h"

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "engine/core/error.h"
#include "engine/core/parallel.h"
#include "engine/core/spread_indices.h"
#include "engine/render/renderer.h"
#include "engine/render/sh_basis.h"

namespace litags {
namespace {

// Pictures that weights are summed over: enough to see every part of a room, and seconds of work.
constexpr size_t kWeighingViews = 64;
constexpr int kWeighingSide = 320;  // px, the longer one

using ShMatrix = Eigen::Matrix<double, 16, 16>;
using RotationMatrix = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

// Coefficients of f'(d) = f(R^T d) from those of f. Harmonics of one degree turn into each other,
// so the matrix that maps values at some directions to values at the turned ones is exact.
ShMatrix ShRotation(const RotationMatrix& rotation) {
  constexpr int kDirections = 48;  // more than 16, well spread: a spiral from pole to pole
  Eigen::Matrix<double, kDirections, 16> before, after;
  for (int i = 0; i < kDirections; ++i) {
    const double z = 1 - (2 * i + 1.0) / kDirections, r = std::sqrt(1 - z * z);
    const double angle = 2.399963229728653 * i;  // the golden angle
    const Eigen::Vector3d d(r * std::cos(angle), r * std::sin(angle), z);
    const Eigen::Vector3d turned = rotation * d;
    using Row = Eigen::Map<const Eigen::Matrix<double, 1, 16>>;
    before.row(i) = Row(ShBasis(d.x(), d.y(), d.z()).data());
    after.row(i) = Row(ShBasis(turned.x(), turned.y(), turned.z()).data());
  }
  // after c' = before c for all c.
  ShMatrix exact = after.colPivHouseholderQr().solve(before);
  // What rounding puts between degrees is not theirs.
  for (int i = 0; i < 16; ++i) {
    for (int j = 0; j < 16; ++j) {
      const auto degree = [](int k) { return k < 1 ? 0 : k < 4 ? 1 : k < 9 ? 2 : 3; };
      if (degree(i) != degree(j)) exact(i, j) = 0;
    }
  }
  return exact;
}

void TurnView(const RotationMatrix& rotation, double scale, Camera* camera) {
  const Eigen::Map<const RotationMatrix> old(camera->R.data());
  const RotationMatrix turned = old * rotation.transpose();
  std::copy_n(turned.data(), 9, camera->R.data());
  for (double& t : camera->t) t *= scale;
}

void KeepOnly(const std::vector<size_t>& kept, Splats* splats) {
  for (size_t to = 0; to < kept.size(); ++to) {
    if (kept[to] != to) splats->Copy(*splats, kept[to], to);
  }
  splats->Resize(kept.size());
}

// Sums of alpha T over the pixels of the views: the derivative of the sum of a colour by the
// coefficient of degree 0, but for a factor.
absl::Status Weigh(const ViewerScene& scene, int threads, const CancelToken& cancel,
                   std::vector<double>* weights) {
  Renderer renderer;
  RenderSettings settings;
  settings.num_channels = kColorOnly;
  settings.sh_degree = 0;
  settings.pixel_filter = scene.antialiased ? PixelFilter::kMip : PixelFilter::kDilate;
  settings.near_plane = scene.near_plane;
  settings.threads = threads;
  settings.cancel = &cancel;
  Planes image, alpha;
  for (const size_t v : SpreadIndices(scene.views.size(), kWeighingViews)) {
    const Camera camera = scene.views[v].camera.ShrunkTo(kWeighingSide);
    renderer.Forward(scene.splats, camera, settings, &image, &alpha);
    LITAGS_RETURN_IF_ERROR(cancel.Check());
    Planes ones(3, camera.height, camera.width);
    std::fill_n(ones.data.begin(), ones.plane_size(), 1.0f);  // of red
    renderer.Backward(scene.splats, ones, Planes(),
                      [&](size_t block, const float* grads, uint32_t) {
                        for (int lane = 0; lane < kSplatBlock; ++lane) {
                          const size_t i = block * kSplatBlock + lane;
                          if (i < weights->size())
                            (*weights)[i] += grads[kShDc * kSplatBlock + lane];
                        }
                      });
  }
  return absl::OkStatus();
}

}  // namespace

std::array<float, 4> UnitQuat(const Splats& splats, size_t i) {
  std::array<float, 4> q;
  double norm = 0;
  for (int k = 0; k < 4; ++k) {
    q[k] = splats.at(i, kRawQuat + k);
    norm += double{q[k]} * q[k];
  }
  if (!(norm > 0)) return {1, 0, 0, 0};
  for (float& v : q) v = static_cast<float>(v / std::sqrt(norm));
  return q;
}

void Rotate(const Matrix3& rotation, Splats* splats, int threads) {
  const RotationMatrix turn = Eigen::Map<const RotationMatrix>(rotation.data());
  const Eigen::Quaterniond turn_quat(turn);
  const ShMatrix sh = ShRotation(turn);
  ParallelFor(threads, splats->num_blocks(), [&](size_t block, int) {
    const size_t end = std::min(splats->size(), (block + 1) * kSplatBlock);
    for (size_t i = block * kSplatBlock; i < end; ++i) {
      const auto at = [&](int row) -> float& { return splats->at(i, row); };
      const Eigen::Vector3d mean = turn * Eigen::Vector3d(at(kMean), at(kMean + 1), at(kMean + 2));
      for (int k = 0; k < 3; ++k) at(kMean + k) = static_cast<float>(mean[k]);
      const Eigen::Quaterniond q =
          turn_quat *
          Eigen::Quaterniond(at(kRawQuat), at(kRawQuat + 1), at(kRawQuat + 2), at(kRawQuat + 3));
      const double turned[4] = {q.w(), q.x(), q.y(), q.z()};
      for (int k = 0; k < 4; ++k) at(kRawQuat + k) = static_cast<float>(turned[k]);
      for (int c = 0; c < 3; ++c) {
        Eigen::Matrix<double, 16, 1> in;
        for (int k = 0; k < 16; ++k) in[k] = at(ShRow(k, c));
        const Eigen::Matrix<double, 16, 1> out = sh * in;
        for (int k = 1; k < 16; ++k) at(ShRow(k, c)) = static_cast<float>(out[k]);
      }
    }
  });
}

std::array<double, 3> DirectionOf(UpAxis axis) {
  switch (axis) {
    case UpAxis::kX:
      return {1, 0, 0};
    case UpAxis::kNegativeX:
      return {-1, 0, 0};
    case UpAxis::kY:
      return {0, 1, 0};
    case UpAxis::kNegativeY:
      return {0, -1, 0};
    case UpAxis::kZ:
      return {0, 0, 1};
    default:
      return {0, 0, -1};
  }
}

Matrix3 RotationTo(const std::array<double, 3>& up, UpAxis axis) {
  if (axis == UpAxis::kKeep) return {1, 0, 0, 0, 1, 0, 0, 0, 1};
  const RotationMatrix rotation =
      Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d(up.data()),
                                         Eigen::Vector3d(DirectionOf(axis).data()))
          .toRotationMatrix();
  Matrix3 out;
  std::copy_n(rotation.data(), 9, out.data());
  return out;
}

void PlaceScene(const std::array<double, 3>& up, UpAxis axis, double scale, ViewerScene* scene,
                int threads) {
  const Matrix3 rotation = RotationTo(up, axis);
  if (axis != UpAxis::kKeep) Rotate(rotation, &scene->splats, threads);
  scene->up = axis;
  const RotationMatrix turn = Eigen::Map<const RotationMatrix>(rotation.data());
  const Eigen::Vector3d origin = scale * (turn * Eigen::Vector3d(scene->origin.data()));
  std::copy_n(origin.data(), 3, scene->origin.data());
  const Eigen::Vector3d center = scale * (turn * Eigen::Vector3d(scene->center.data()));
  std::copy_n(center.data(), 3, scene->center.data());
  const Eigen::Vector3d turned_up = turn * Eigen::Vector3d(scene->up_direction.data());
  std::copy_n(turned_up.data(), 3, scene->up_direction.data());
  scene->radius *= scale;
  for (View& view : scene->views) TurnView(turn, scale, &view.camera);
  if (scale == 1) return;
  const float log_scale = static_cast<float>(std::log(scale));
  for (size_t i = 0; i < scene->splats.size(); ++i) {
    for (int k = 0; k < 3; ++k) {
      float& mean = scene->splats.at(i, kMean + k);
      mean = static_cast<float>(scale * mean);
      scene->splats.at(i, kLogScale + k) += log_scale;
    }
  }
}

void Crop(const Box& box, ViewerScene* scene) {
  std::vector<size_t> kept;
  for (size_t i = 0; i < scene->splats.size(); ++i) {
    std::array<double, 3> mean;
    for (int k = 0; k < 3; ++k) mean[k] = scene->splats.at(i, kMean + k) + scene->origin[k];
    if (box.Holds(mean)) kept.push_back(i);
  }
  KeepOnly(kept, &scene->splats);
}

absl::Status KeepHeaviest(int64_t count, int threads, const CancelToken& cancel,
                          ViewerScene* scene) {
  const size_t size = scene->splats.size();
  if (count < 0 || static_cast<size_t>(count) >= size) return absl::OkStatus();
  std::vector<double> weights(size);
  LITAGS_RETURN_IF_ERROR(Weigh(*scene, threads, cancel, &weights));
  std::vector<size_t> order(size);
  std::iota(order.begin(), order.end(), size_t{0});
  std::nth_element(order.begin(), order.begin() + count, order.end(), [&](size_t a, size_t b) {
    return weights[a] != weights[b] ? weights[a] > weights[b] : a < b;
  });
  order.resize(static_cast<size_t>(count));
  std::sort(order.begin(), order.end());
  KeepOnly(order, &scene->splats);
  return absl::OkStatus();
}

}  // namespace litags
