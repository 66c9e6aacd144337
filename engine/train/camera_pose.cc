#include "engine/train/camera_pose.h"

#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <cmath>

namespace litags {
namespace {

// The root of the sum of given cameras' squared distances from their mean, over the extent: with
// less they are at one place. Refined ones drift by about as much in an epoch. Choice
constexpr double kOnePlace = 1e-3;

using RowMajor = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

// x_cam' = exp([w]) x_cam + v.
void Move(const Eigen::Vector3d& w, const Eigen::Vector3d& v, CameraPose* pose) {
  Eigen::Map<RowMajor> R(pose->R.data());
  Eigen::Map<Eigen::Vector3d> t(pose->t.data());
  const double angle = w.norm();
  const Eigen::Quaterniond turn(angle > 0 ? Eigen::AngleAxisd(angle, w / angle)
                                          : Eigen::AngleAxisd::Identity());
  R = (turn * Eigen::Quaterniond(R)).normalized().toRotationMatrix();
  t = turn * t + v;
}

Eigen::Map<const RowMajor> RotationOf(const CameraPose& pose) {
  return Eigen::Map<const RowMajor>(pose.R.data());
}

Eigen::Vector3d CenterOf(const CameraPose& pose) {
  return -RotationOf(pose).transpose() * Eigen::Map<const Eigen::Vector3d>(pose.t.data());
}

Eigen::Vector3d MeanCenter(absl::Span<const CameraPose> poses) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const CameraPose& pose : poses) sum += CenterOf(pose);
  return sum / static_cast<double>(poses.size());
}

}  // namespace

bool StepPose(const PoseVector& grad, int step, double lr, double extent,
              const AdamConstants& constants, CameraPose* pose) {
  const double b1 = constants.beta1, b2 = constants.beta2;
  CameraPose next = *pose;
  Eigen::Matrix<double, 6, 1> move;
  for (int k = 0; k < 6; ++k) {
    next.moment1[k] = b1 * next.moment1[k] + (1 - b1) * grad[k];
    next.moment2[k] = b2 * next.moment2[k] + (1 - b2) * grad[k] * grad[k];
    const double mean = next.moment1[k] / (1 - std::pow(b1, step));
    const double square = next.moment2[k] / (1 - std::pow(b2, step));
    move[k] = -lr * (k < 3 ? 1 : extent) * mean / (std::sqrt(square) + constants.epsilon);
  }
  if (!move.allFinite()) return false;
  Move(move.head<3>(), move.tail<3>(), &next);
  *pose = next;
  return true;
}

Similarity AlignPoses(absl::Span<const CameraPose> from, absl::Span<const CameraPose> to,
                      double extent) {
  const Eigen::Vector3d from_mean = MeanCenter(from), to_mean = MeanCenter(to);
  Eigen::Matrix3d turns = Eigen::Matrix3d::Zero(), places = Eigen::Matrix3d::Zero();
  double from_spread = 0, to_spread = 0;
  for (size_t i = 0; i < from.size(); ++i) {
    const Eigen::Vector3d a = CenterOf(from[i]) - from_mean, b = CenterOf(to[i]) - to_mean;
    turns += RotationOf(to[i]).transpose() * RotationOf(from[i]);
    places += b * a.transpose();
    from_spread += a.squaredNorm();
    to_spread += b.squaredNorm();
  }
  // The rotation nearest to a matrix: Umeyama 1991.
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(turns + places / (extent * extent),
                                              Eigen::ComputeFullU | Eigen::ComputeFullV);
  const double sign = (svd.matrixU() * svd.matrixV().transpose()).determinant();
  const Eigen::Matrix3d R =
      svd.matrixU() * Eigen::Vector3d(1, 1, sign).asDiagonal() * svd.matrixV().transpose();
  Similarity out;
  const double along = (R.transpose() * places).trace();
  const double one_place = kOnePlace * extent;
  if (along > 0 && to_spread > one_place * one_place) out.scale = along / from_spread;
  Eigen::Map<RowMajor>(out.R.data()) = R;
  Eigen::Map<Eigen::Vector3d>(out.t.data()) = to_mean - out.scale * (R * from_mean);
  return out;
}

void MoveWorld(const Similarity& move, Splats* splats, absl::Span<CameraPose> poses) {
  const Eigen::Matrix3d R = Eigen::Map<const RowMajor>(move.R.data());
  const Eigen::Vector3d t = Eigen::Map<const Eigen::Vector3d>(move.t.data());
  const Eigen::Quaterniond turn(R);
  for (size_t i = 0; i < splats->size(); ++i) {
    Eigen::Vector3d mean(splats->at(i, kMean), splats->at(i, kMean + 1), splats->at(i, kMean + 2));
    mean = move.scale * (R * mean) + t;
    const Eigen::Quaterniond quat =
        turn * Eigen::Quaterniond(splats->at(i, kRawQuat), splats->at(i, kRawQuat + 1),
                                  splats->at(i, kRawQuat + 2), splats->at(i, kRawQuat + 3));
    for (int k = 0; k < 3; ++k) {
      splats->at(i, kMean + k) = static_cast<float>(mean[k]);
      splats->at(i, kLogScale + k) += static_cast<float>(std::log(move.scale));
      splats->at(i, kRawQuat + 1 + k) = static_cast<float>(quat.vec()[k]);
    }
    splats->at(i, kRawQuat) = static_cast<float>(quat.w());
  }
  for (CameraPose& pose : poses) {
    Eigen::Map<RowMajor> pose_R(pose.R.data());
    Eigen::Map<Eigen::Vector3d> pose_t(pose.t.data());
    pose_R = Eigen::Quaterniond(pose_R * R.transpose()).normalized().toRotationMatrix();
    pose_t = move.scale * pose_t - pose_R * t;
  }
}

PoseDifference DifferenceOf(const Camera& a, const Camera& b) {
  const CameraPose from(a), to(b);
  const Eigen::AngleAxisd turn(Eigen::Matrix3d(RotationOf(to) * RotationOf(from).transpose()));
  return {std::abs(turn.angle()) * 180 / M_PI, (CenterOf(to) - CenterOf(from)).norm()};
}

}  // namespace litags
