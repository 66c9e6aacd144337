#include "engine/sfm/turning.h"

#include <Eigen/Geometry>

#include "engine/core/rng.h"
#include "gtest/gtest.h"

namespace litags {
namespace {

constexpr double kSide = 400, kFocal = 350;  // px

// What two cameras see of points at `depth` of the first, or at twice of it where `deep`, every
// second one; features lie up to half a pixel off.
SeenTwice See(const Eigen::Matrix3d& R, const Eigen::Vector3d& t, bool deep, uint64_t seed) {
  const CounterRng rng(seed, 0);
  SeenTwice seen;
  for (uint64_t i = 0; i < 200; ++i) {
    const auto random = [&](uint64_t k) { return rng.Uniform(4 * i + k) - 0.5; };
    const Eigen::Vector2d first(kSide * random(0), 0.75 * kSide * random(1));
    const double depth = deep && i % 2 == 1 ? 20 : 10;
    const Eigen::Vector3d point =
        first.homogeneous().cwiseProduct(Eigen::Vector3d(1 / kFocal, 1 / kFocal, 1)) * depth;
    const Eigen::Vector3d in_second = R * point + t;
    if (in_second.z() < 1) continue;
    seen.first.push_back(first);
    seen.second.push_back(in_second.hnormalized() * kFocal + Eigen::Vector2d(random(2), random(3)));
  }
  return seen;
}

Eigen::Matrix3d Turn(double about_x, double about_y) {
  return (Eigen::AngleAxisd(about_x, Eigen::Vector3d::UnitX()) *
          Eigen::AngleAxisd(about_y, Eigen::Vector3d::UnitY()))
      .toRotationMatrix();
}

bool Turned(const std::vector<SeenTwice>& pairs) {
  return TurnedInPlace(pairs, kSide, CancelToken()).value();
}

TEST(Turning, ATurnIsOneWhateverTheDepth) {
  std::vector<SeenTwice> pairs;
  for (int i = 1; i < 6; ++i) {
    pairs.push_back(See(Turn(0.03 * i, 0.1 * i), Eigen::Vector3d::Zero(), i % 2 == 0, i));
  }
  EXPECT_TRUE(Turned(pairs));
}

TEST(Turning, AStepToTheSideOfADeepSceneIsNone) {
  std::vector<SeenTwice> pairs;
  for (int i = 1; i < 6; ++i) pairs.push_back(See(Turn(0, 0.1 * i), {0.5 * i, 0, 0}, true, i));
  EXPECT_FALSE(Turned(pairs));
}

TEST(Turning, AWallThatIsWalkedAlongOrUpToIsNone) {
  std::vector<SeenTwice> along, up_to;
  const Eigen::Matrix3d straight = Eigen::Matrix3d::Identity();
  for (int i = 1; i < 6; ++i) {
    along.push_back(See(straight, {1.0 * i, 0, 0}, false, i));
    up_to.push_back(See(straight, {0, 0, -0.6 * i}, false, i));
  }
  EXPECT_FALSE(Turned(along));
  EXPECT_FALSE(Turned(up_to));
}

TEST(Turning, NoPairsAreNoTurn) { EXPECT_FALSE(Turned({})); }

TEST(Turning, IsNotAskedOnceCancelled) {
  CancelToken cancel;
  cancel.Cancel();
  const std::vector<SeenTwice> pairs = {See(Turn(0, 0.1), Eigen::Vector3d::Zero(), false, 1)};
  EXPECT_EQ(TurnedInPlace(pairs, kSide, cancel).status().code(), absl::StatusCode::kCancelled);
}

}  // namespace
}  // namespace litags
