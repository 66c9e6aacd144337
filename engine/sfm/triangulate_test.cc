#include "engine/sfm/triangulate.h"

#include <Eigen/Geometry>
#include <cmath>
#include <set>
#include <utility>

#include "engine/core/rng.h"
#include "engine/sfm/photo_rays.h"
#include "engine/sfm/tracks.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace litags {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::SizeIs;

constexpr int kWidth = 400, kHeight = 300;

Camera CameraAt(double x, double y) {
  Camera camera = {.width = kWidth, .height = kHeight, .fx = 350, .fy = 350, .cx = 200, .cy = 150};
  EXPECT_TRUE(camera.LookAt({x, y, -6}, {0, 0, 0}, {0, -1, 0}).ok());
  return camera;
}

Eigen::Vector2d Distorted(const Distortion& d, double x, double y) {
  const double r2 = x * x + y * y, radial = 1 + r2 * (d.k1 + r2 * d.k2);
  return {x * radial + 2 * d.p1 * x * y + d.p2 * (r2 + 2 * x * x),
          y * radial + d.p1 * (r2 + 2 * y * y) + 2 * d.p2 * x * y};
}

Eigen::Vector2d Seen(const Camera& camera, const Distortion& d, const Eigen::Vector3d& world) {
  const auto p = camera.CamFromWorld({world.x(), world.y(), world.z()});
  const Eigen::Vector2d n = Distorted(d, p[0] / p[2], p[1] / p[2]);
  return {camera.fx * n.x() + camera.cx, camera.fy * n.y() + camera.cy};
}

// Points in a cube, seen by cameras in a row with some noise. Feature i of photo p is of point
// (i + 7 p) modulo their number, so that no index is right by chance.
struct World {
  World(int cameras, int points, double noise_px, Distortion lens = {}, double step = 0.5) {
    const CounterRng rng(1, 0);
    for (int i = 0; i < points; ++i) {
      truth.emplace_back(3 * rng.Uniform(3 * i) - 1.5, 2 * rng.Uniform(3 * i + 1) - 1,
                         2 * rng.Uniform(3 * i + 2) - 1);
    }
    for (int p = 0; p < cameras; ++p) {
      const Camera camera = CameraAt(step * (p - 2), 0.4 * step * (p % 2));
      const CounterRng noise(2, p);
      std::vector<Eigen::Vector2d> seen;
      for (int i = 0; i < points; ++i) {
        seen.push_back(Seen(camera, lens, truth[PointOf({p, i})]) +
                       noise_px * Eigen::Vector2d(noise.Normal(2 * i), noise.Normal(2 * i + 1)));
      }
      photos.emplace_back(camera, lens, seen);
    }
  }

  int PointOf(const Observation& o) const {
    return (o.feature + 7 * o.photo) % static_cast<int>(truth.size());
  }
  int FeatureOf(int photo, int point) const {
    const int n = static_cast<int>(truth.size());
    return ((point - 7 * photo) % n + n) % n;
  }

  // Right matches of all pairs, and one in `wrong` matches with a feature of another point.
  std::vector<PhotoMatches> Matches(int wrong = 0) const {
    std::vector<PhotoMatches> pairs;
    const int n = static_cast<int>(truth.size());
    for (int a = 0; a < static_cast<int>(photos.size()); ++a) {
      for (int b = a + 1; b < static_cast<int>(photos.size()); ++b) {
        PhotoMatches& pair = pairs.emplace_back(PhotoMatches{a, b, {}});
        for (int i = 0; i < n; ++i) {
          const bool off = wrong > 0 && (i + a + 3 * b) % wrong == 0;
          pair.matches.push_back({static_cast<uint32_t>(FeatureOf(a, i)),
                                  static_cast<uint32_t>(FeatureOf(b, off ? (i + 11) % n : i))});
        }
      }
    }
    return pairs;
  }

  std::vector<Eigen::Vector3d> truth;
  std::vector<PhotoRays> photos;
};

std::vector<TriangulatedPoint> Triangulate(const World& world,
                                           const std::vector<PhotoMatches>& matches,
                                           int threads = 0) {
  const auto pairs = VerifyPairs(world.photos, matches, threads);
  auto points = TriangulatePairs(world.photos, pairs, threads, CancelToken());
  EXPECT_TRUE(points.ok()) << points.status();
  return *std::move(points);
}

TEST(PhotoRays, PointsAreWhereALensWithoutDistortionHasThem) {
  const Distortion lens = {.k1 = -0.1, .k2 = 0.02, .p1 = 0.001, .p2 = -0.002};
  const Camera camera = CameraAt(0, 0);
  const Eigen::Vector3d world(0.7, -0.4, 0.3);
  const Eigen::Vector2d seen = Seen(camera, lens, world), ideal = Seen(camera, {}, world);
  EXPECT_GT((seen - ideal).norm(), 0.1);
  EXPECT_LT((UndistortPoint(camera, lens, seen).value() - ideal).norm(), 1e-6);
  EXPECT_EQ(UndistortPoint(camera, {}, seen), seen);
}

// The lens puts nothing farther out than 0.385 of the focal length, 135 px.
TEST(PhotoRays, FeaturesWhereTheLensPutsNoPointAreNotMatched) {
  const Distortion lens = {.k1 = -1};
  const Camera first = CameraAt(0, 0), second = CameraAt(0.5, 0);
  EXPECT_EQ(UndistortPoint(first, lens, {390, 150}), std::nullopt);
  const std::vector<Eigen::Vector2d> features = {{390, 150}, {210, 150}};
  const PhotoRays a(first, lens, features), b(second, lens, {{370, 150}, {200, 150}});
  const auto verified = VerifyMatches(a, b, {{0, 0}, {1, 1}}, 4);
  ASSERT_THAT(verified, SizeIs(1));
  EXPECT_EQ(verified[0].feature1, 1);
}

TEST(PhotoRays, ASecondFeatureAtAPlaceIsATwinOfTheFirst) {
  const PhotoRays photo(CameraAt(0, 0), {}, {{5, 6}, {7, 8}, {5, 6}, {5, 8}});
  EXPECT_THAT(photo.twin_of, ElementsAre(0, 1, 0, 3));
}

TEST(PhotoRays, SampsonErrorIsTheDistanceFromTheEpipolarGeometry) {
  const World world(2, 20, 0);
  const Eigen::Matrix3d F = FundamentalMatrix(world.photos[0], world.photos[1]);
  for (int i = 0; i < 20; ++i) {
    const Eigen::Vector2d a = world.photos[0].points[world.FeatureOf(0, i)];
    const Eigen::Vector2d b = world.photos[1].points[world.FeatureOf(1, i)];
    EXPECT_LT(SampsonError(F, a, b), 1e-9);
    // Across the line, of which the two points share the correction.
    const Eigen::Vector2d normal = (F * a.homogeneous()).head<2>().normalized();
    EXPECT_NEAR(SampsonError(F, a, b + 2 * normal), 2 / std::sqrt(2), 0.1);
  }
}

TEST(PhotoRays, MatchesBehindACameraOrOffTheLineAreNotVerified) {
  const World world(2, 40, 0);
  const auto all = VerifyMatches(world.photos[0], world.photos[1], world.Matches()[0].matches, 4);
  EXPECT_THAT(all, SizeIs(40));
  // The second camera turned about: the same lines, the other way.
  std::vector<PhotoRays> turned = world.photos;
  for (Eigen::Vector3d& ray : turned[1].rays) ray = -ray;
  EXPECT_THAT(VerifyMatches(turned[0], turned[1], world.Matches()[0].matches, 4), IsEmpty());
  EXPECT_LT(VerifyMatches(world.photos[0], world.photos[1], world.Matches(1)[0].matches, 4).size(),
            15u);
}

TEST(Tracks, NeverHoldTwoFeaturesOfAPhoto) {
  // 0/0 - 1/0 - 2/0, and 2/1, which is matched with 0/0 less well.
  const std::vector<VerifiedPhotoPair> pairs = {
      {0, 1, {{0, 0, 0.5}}}, {0, 2, {{0, 1, 0.7}}}, {1, 2, {{0, 0, 0.1}}}};
  const MatchGraph graph({1, 1, 2}, pairs);
  EXPECT_THAT(graph.Neighbours(graph.Id({0, 0})), ElementsAre(graph.Id({1, 0}), graph.Id({2, 1})));
  EXPECT_EQ(graph.Of(graph.Id({2, 1})), (Observation{2, 1}));
  EXPECT_THAT(BuildTracks(graph, pairs),
              ElementsAre(ElementsAre(Observation{0, 0}, Observation{1, 0}, Observation{2, 0})));
}

TEST(Triangulate, FindsThePointThatMostFeaturesAgreeOn) {
  const World world(5, 30, 0);
  std::vector<Observation> track;
  for (int p = 0; p < 5; ++p) track.push_back({p, world.FeatureOf(p, 4)});
  track[2].feature = world.FeatureOf(2, 9);
  const TriangulatedPoint point = TriangulateTrack(world.photos, track);
  EXPECT_LT((point.xyz - world.truth[4]).norm(), 1e-6);
  EXPECT_THAT(point.track, ElementsAre(track[0], track[1], track[3], track[4]));
  EXPECT_LT(point.error, 1e-6);
}

TEST(Triangulate, RaysThatHardlyMeetAreNoPoint) {
  for (const auto& [step, features] : {std::pair{0.5, 2}, {0.1, 0}}) {  // 5 degrees, 1 degree
    const World world(2, 30, 0, {}, step);
    const std::vector<Observation> track = {{0, world.FeatureOf(0, 4)}, {1, world.FeatureOf(1, 4)}};
    EXPECT_THAT(TriangulateTrack(world.photos, track).track, SizeIs(features));
  }
}

TEST(Triangulate, FindsEveryPointAmongWrongMatches) {
  const Distortion lens = {.k1 = -0.05};
  for (const int wrong : {0, 4}) {
    const World world(6, 200, 0.5, lens);
    const auto points = Triangulate(world, world.Matches(wrong));
    std::set<int> found;
    for (const TriangulatedPoint& point : points) {
      if (point.track.size() < 4) continue;
      const int index = world.PointOf(point.track[0]);
      found.insert(index);
      // 0.5 px at 6 units and 350 px are 0.009 across, some times as much in depth.
      EXPECT_LT((point.xyz - world.truth[index]).norm(), 0.15);
      EXPECT_LT(point.error, 1.5);
    }
    EXPECT_GE(found.size(), 198u) << wrong;
  }
}

// A track breaks where a match is missing; the point takes the rest in.
TEST(Triangulate, JoinsTracksThatAreOnePoint) {
  const World world(4, 60, 0.2);
  std::vector<PhotoMatches> pairs = world.Matches();
  const std::vector<TriangulatedPoint> points = Triangulate(world, pairs);
  EXPECT_THAT(points, SizeIs(60));
  for (const TriangulatedPoint& point : points) EXPECT_THAT(point.track, SizeIs(4));
}

TEST(Triangulate, APointOfTwoPhotosNeedsASmallErrorAndALargeAngle) {
  const World world(2, 100, 1.0);  // 0.56 px from each feature, on average
  const auto points = Triangulate(world, world.Matches());
  EXPECT_GT(points.size(), 40u);
  EXPECT_LT(points.size(), 90u);
  for (const TriangulatedPoint& point : points) EXPECT_LE(point.error, 0.5);
  const World narrow(2, 100, 0, {}, 0.3);  // 3 degrees
  EXPECT_THAT(Triangulate(narrow, narrow.Matches()), IsEmpty());
}

TEST(Triangulate, PhotosWithFewMatchesThatFitAreNotOfOnePlace) {
  const World few(3, 14, 0), enough(3, 15, 0);
  EXPECT_THAT(Triangulate(few, few.Matches()), IsEmpty());
  EXPECT_THAT(Triangulate(enough, enough.Matches()), SizeIs(15));
}

TEST(Triangulate, GivesTheSameBitsForAnyNumberOfThreads) {
  const World world(6, 300, 1.0);
  const auto once = Triangulate(world, world.Matches(3), 1);
  ASSERT_GT(once.size(), 200u);
  for (const int threads : {2, 3, 7}) {
    const auto again = Triangulate(world, world.Matches(3), threads);
    ASSERT_EQ(again.size(), once.size());
    for (size_t i = 0; i < once.size(); ++i) {
      EXPECT_EQ(again[i].xyz, once[i].xyz);
      EXPECT_EQ(again[i].error, once[i].error);
      EXPECT_EQ(again[i].track, once[i].track);
    }
  }
}

TEST(Triangulate, EndsWhenCancelled) {
  const World world(3, 30, 0);
  const auto pairs = VerifyPairs(world.photos, world.Matches(), 0);
  CancelToken cancel;
  cancel.Cancel();
  EXPECT_EQ(TriangulatePairs(world.photos, pairs, 0, cancel).status().code(),
            absl::StatusCode::kCancelled);
}

}  // namespace
}  // namespace litags
