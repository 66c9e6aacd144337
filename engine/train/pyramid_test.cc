#include "engine/train/pyramid.h"

#include <gtest/gtest.h>

#include "engine/core/mask.h"
#include "engine/core/splats.h"
#include "engine/train/train_test_util.h"

namespace litags {
namespace {

TrainView OddView() {
  TrainView view;
  view.view.camera = RingCamera(0, 4, 5, 4);
  view.photo = Photo(5, 4);
  for (size_t i = 0; i < view.photo.data.size(); ++i) view.photo.data[i] = i * 3;
  view.target = view.photo;
  for (int16_t& sample : view.target.data) sample += 50;
  view.structure = PlaneU8(5, 4);
  for (size_t i = 0; i < view.structure.data.size(); ++i) view.structure.data[i] = i;
  view.information = view.structure;
  return view;
}

TEST(HalfSize, AveragesPixelsAndKeepsRaysWhereTheyWere) {
  const TrainView view = OddView();
  const TrainView half = HalfSize(view);
  EXPECT_EQ(half.photo.width, 2);
  EXPECT_EQ(half.photo.height, 2);
  EXPECT_EQ(half.view.camera.width, 2);
  // Pixels (2, 2), (3, 2), (2, 3), (3, 3), channel 1.
  int sum = 0;
  for (const auto& [x, y] : {std::pair{2, 2}, {3, 2}, {2, 3}, {3, 3}}) {
    sum += view.photo.pixel(x, y)[1];
  }
  EXPECT_EQ(half.photo.pixel(1, 1)[1], (sum + 2) / 4);
  EXPECT_EQ(half.target.pixel(1, 1)[1], (sum + 2) / 4 + 50);
  EXPECT_EQ(half.structure.data[0], (0 + 1 + 5 + 6 + 2) / 4);
  EXPECT_EQ(half.information.data, half.structure.data);
  // The corner between four pixels is the centre of the pixel that replaces them.
  const Camera &a = view.view.camera, &b = half.view.camera;
  EXPECT_DOUBLE_EQ((1.0 - a.cx) / a.fx, (0.5 - b.cx) / b.fx);
  EXPECT_DOUBLE_EQ((3.0 - a.cy) / a.fy, (1.5 - b.cy) / b.fy);
  EXPECT_FALSE(half.depth.has_value());
}

TEST(HalfSize, RoundsBelowBlackAsAbove) {
  TrainView view = OddView();
  const Photo half = HalfSize(view).photo;
  for (int16_t& sample : view.photo.data) sample -= 1000;
  const Photo below = HalfSize(view).photo;
  for (size_t i = 0; i < half.data.size(); ++i) EXPECT_EQ(below.data[i], half.data[i] - 1000);
}

TEST(HalfSize, APixelCountsIfAllFourDo) {
  TrainView view = OddView();
  EXPECT_TRUE(HalfSize(view).mask.empty());
  view.mask = PlaneU8(5, 4);
  std::fill(view.mask.data.begin(), view.mask.data.end(), kCounts);
  view.mask.data[1 * 5 + 2] = 0;  // of (1, 0)
  view.mask.data[2 * 5 + 4] = 0;  // in the column that is left out
  EXPECT_EQ(HalfSize(view).mask.data, (std::vector<uint8_t>{255, 0, 255, 255}));
}

TEST(HalfSize, DepthIsTheMeanOfKnownPixels) {
  TrainView view = OddView();
  view.depth.emplace();
  view.depth->depth = Planes(1, 4, 5);
  view.depth->confidence = Planes(1, 4, 5);
  view.depth->depth.at(0, 0, 0) = 2;
  view.depth->depth.at(0, 1, 1) = 4;
  view.depth->confidence.at(0, 0, 0) = 1;
  view.depth->confidence.at(0, 1, 1) = 1;
  view.depth->edge = 0.5;
  const DepthMap half = *HalfSize(view).depth;
  EXPECT_FLOAT_EQ(half.depth.at(0, 0, 0), 3);
  EXPECT_FLOAT_EQ(half.confidence.at(0, 0, 0), 0.5);
  EXPECT_FLOAT_EQ(half.depth.at(0, 1, 1), 0);
  EXPECT_FLOAT_EQ(half.confidence.at(0, 1, 1), 0);
  EXPECT_EQ(half.edge, 0.5);
}

TEST(HalfSize, ASmallDepthMapStaysAsItIs) {
  TrainView view = OddView();
  view.depth = DepthMap{Planes(1, 2, 3), Planes()};
  EXPECT_EQ(HalfSize(view).depth->depth.width, 3);
}

// Of the first iterations, which have SH of degree 1.
const double kOfGaussian = kPixelsOfGaussian * SplatRowsForDegree(1) / double{kSplatRows};

std::vector<TrainView> OneView(int width, int height) {
  TrainView view;
  view.view.camera = RingCamera(0, 4, width, height);
  view.photo = view.target = Photo(width, height);
  return {view};
}

TEST(ViewPyramid, LevelsShareTheCoarsePartEqually) {
  const std::vector<TrainView> views = OneView(300, 256);
  TrainOptions options;
  options.iterations = 100;
  options.recipe.coarse_levels = 2;
  options.recipe.coarse_until = 0.5;
  const ViewPyramid pyramid(&views, options);
  EXPECT_EQ(pyramid.LevelOf(0), 2);
  EXPECT_EQ(pyramid.LevelOf(24), 2);
  EXPECT_EQ(pyramid.LevelOf(25), 1);
  EXPECT_EQ(pyramid.LevelOf(49), 1);
  EXPECT_EQ(pyramid.LevelOf(50), 0);
  EXPECT_EQ(pyramid.LevelOf(99), 0);
  EXPECT_EQ(pyramid.CoarseEnd(), 50);
  constexpr double kPixels = 300 * 256, kGaussians = 1000;
  const double kBeside = kPixelsBeside + kOfGaussian * kGaussians;
  EXPECT_DOUBLE_EQ(pyramid.WorkOf(0, kGaussians), kPixels / 16 + kBeside);
  EXPECT_DOUBLE_EQ(pyramid.WorkOf(49, kGaussians), kPixels / 4 + kBeside);
  EXPECT_DOUBLE_EQ(pyramid.WorkOf(50, kGaussians), kPixels + kBeside);
  EXPECT_EQ(pyramid.View(2, 0).photo.width, 75);
  EXPECT_EQ(pyramid.View(0, 0).photo.width, 300);
}

// Growth ends with the coarse part where photos are few: without a step then, the budget of full
// size would never be used.
TEST(ViewPyramid, TheCoarsePartEndsWithADensityStepOfAnyLengthOfRun) {
  const std::vector<TrainView> views = OneView(256, 128);
  TrainOptions options;
  options.recipe.coarse_levels = 1;
  options.recipe.densify_every = 200;
  for (const auto& [iterations, end] :
       {std::pair{2000, 1000}, {3000, 1400}, {15'000, 7400}, {300, 150}}) {
    options.iterations = iterations;
    const ViewPyramid pyramid(&views, options);
    EXPECT_EQ(pyramid.CoarseEnd(), end);
    EXPECT_EQ(pyramid.LevelOf(end - 1), 1);
    EXPECT_EQ(pyramid.LevelOf(end), 0);
  }
}

TEST(ViewPyramid, CropsBoundTheWorkOfAnIteration) {
  const std::vector<TrainView> views = OneView(600, 400);
  TrainOptions options;
  options.iterations = 100;
  options.recipe.coarse_levels = 1;
  options.recipe.crop_pixels = 40'000;  // 3 x 2 cells; at half size 2 x 1
  const ViewPyramid pyramid(&views, options);
  constexpr double kGaussians = 1200;
  const double kWhole = kOfGaussian * kGaussians;
  EXPECT_DOUBLE_EQ(pyramid.WorkOf(49, kGaussians), (300 * 200 + kWhole) / 2 + kPixelsBeside);
  EXPECT_DOUBLE_EQ(pyramid.WorkOf(50, kGaussians), (600 * 400 + kWhole) / 6 + kPixelsBeside);
}

TEST(ViewPyramid, GaussiansTakeMoreWorkWithMoreSphericalHarmonics) {
  const std::vector<TrainView> views = OneView(600, 400);
  TrainOptions options;
  options.recipe.sh_interval = 1000;
  const ViewPyramid pyramid(&views, options);
  EXPECT_DOUBLE_EQ(pyramid.WorkOf(999, 1e6) - pyramid.WorkOf(999, 0), kOfGaussian * 1e6);
  EXPECT_DOUBLE_EQ(pyramid.WorkOf(2000, 1e6) - pyramid.WorkOf(2000, 0), kPixelsOfGaussian * 1e6);
}

TEST(ViewPyramid, SmallPhotosAllowFewerGaussians) {
  const std::vector<TrainView> views = OneView(600, 400);
  TrainOptions options;
  options.recipe.coarse_levels = 2;
  options.recipe.coarse_gaussians = 1.5;
  const ViewPyramid pyramid(&views, options);
  EXPECT_EQ(pyramid.MostGaussians(0), options.max_gaussians);
  EXPECT_EQ(pyramid.MostGaussians(1), 300 * 200 * 3 / 2);
  EXPECT_EQ(pyramid.MostGaussians(2), 150 * 100 * 3 / 2);
  options.max_gaussians = 30'000;
  EXPECT_EQ(ViewPyramid(&views, options).MostGaussians(1), 30'000);
  options.recipe.coarse_gaussians = 1e15;
  EXPECT_EQ(ViewPyramid(&views, options).MostGaussians(1), 30'000);
}

TEST(ViewPyramid, SmallPhotosHaveFewerLevels) {
  const std::vector<TrainView> views = OneView(300, 200);
  TrainOptions options;
  options.iterations = 100;
  options.recipe.coarse_levels = 4;
  EXPECT_EQ(ViewPyramid(&views, options).LevelOf(0), 1);
  options.recipe.coarse_levels = 0;
  EXPECT_EQ(ViewPyramid(&views, options).LevelOf(0), 0);
  EXPECT_EQ(ViewPyramid(&views, options).CoarseEnd(), 0);
}

TEST(ViewPyramid, OneSmallPhotoLeavesTheOthersTheirLevels) {
  std::vector<TrainView> views(9, OneView(512, 512)[0]);
  views.push_back(OneView(100, 200)[0]);
  views.push_back(OneView(130, 200)[0]);
  TrainOptions options;
  options.iterations = 100;
  options.recipe.coarse_levels = 2;
  const ViewPyramid pyramid(&views, options);
  EXPECT_EQ(pyramid.LevelOf(0), 2);
  EXPECT_EQ(pyramid.View(2, 0).photo.width, 128);
  EXPECT_EQ(pyramid.View(2, 9).photo.width, 100);
  EXPECT_EQ(pyramid.View(2, 10).photo.width, 65);
  constexpr double kPixels = (9 * 128 * 128 + 100 * 200 + 65 * 100) / 11.0;
  EXPECT_DOUBLE_EQ(pyramid.WorkOf(0, 0), kPixels + kPixelsBeside);
}

TEST(ViewPyramid, WithoutAPhotoIsABug) {
  const std::vector<TrainView> none;
  EXPECT_DEATH(ViewPyramid(&none, TrainOptions()), "check failed: !views->empty");
}

TEST(ViewPyramid, OneLargePhotoGivesTheOthersNoLevels) {
  std::vector<TrainView> views(2, OneView(100, 100)[0]);
  views.push_back(OneView(512, 512)[0]);
  TrainOptions options;
  options.recipe.coarse_levels = 2;
  EXPECT_EQ(ViewPyramid(&views, options).CoarseEnd(), 0);
}

}  // namespace
}  // namespace litags
