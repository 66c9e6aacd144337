#include "engine/pipeline/model_scene.h"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <utility>

#include "engine/core/color.h"
#include "engine/core/error_test_util.h"
#include "engine/core/peak_memory_test_util.h"
#include "engine/core/sandbox.h"
#include "engine/core/temp_dir_test_util.h"
#include "engine/io/ply.h"
#include "engine/io/test_util.h"
#include "engine/pipeline/scene_test_util.h"

namespace litags {
namespace {

TEST(Scene, RendersEveryChannel) {
  const auto scene = MakeScene(SmallModel(), RingViews(5));
  const struct {
    Channel channel;
    int planes;
  } cases[] = {{Channel::kColor, 3}, {Channel::kOriginal, 3},  {Channel::kLight, 3},
               {Channel::kDepth, 1}, {Channel::kStructure, 1}, {Channel::kIllumination, 3},
               {Channel::kNoise, 3}, {Channel::kAlpha, 1}};
  for (const auto& [channel, planes] : cases) {
    SCOPED_TRACE(static_cast<int>(channel));
    const auto image = RenderChannel(*scene, channel);
    ASSERT_TRUE(image.ok()) << image.status();
    EXPECT_EQ(image->channels, planes);
    EXPECT_EQ(image->height, kHeight);
    EXPECT_EQ(image->width, kWidth);
    ASSERT_EQ(image->data.size(), size_t(planes) * kHeight * kWidth);
    float highest = 0;
    for (const float v : image->data) {
      ASSERT_TRUE(std::isfinite(v));
      highest = std::max(highest, v);
    }
    EXPECT_GT(highest, 0) << "nothing to be seen";
  }
}

TEST(Scene, LightGoesFromNormalToThePhotoAndBeyond) {
  const auto scene = MakeScene(SmallModel(), RingViews(5));
  const auto color = RenderChannel(*scene, Channel::kColor);
  const auto original = RenderChannel(*scene, Channel::kOriginal);
  const auto L = RenderChannel(*scene, Channel::kIllumination);
  ASSERT_TRUE(color.ok() && original.ok() && L.ok());
  EXPECT_EQ(RenderChannel(*scene, Channel::kLight, 0)->data, color->data);
  EXPECT_EQ(RenderChannel(*scene, Channel::kLight, 1)->data, original->data);
  EXPECT_NE(color->data, original->data);
  // R L^t wherever nothing is cut at 0 or 1, and L is not too dark.
  for (const double t : {-4.0, -0.5, 0.5, 1.5, 4.0}) {
    const auto lit = RenderChannel(*scene, Channel::kLight, t);
    ASSERT_TRUE(lit.ok()) << lit.status();
    int compared = 0;
    for (size_t i = 0; i < lit->data.size(); ++i) {
      const float R = color->data[i];
      ASSERT_TRUE(lit->data[i] >= 0 && lit->data[i] <= 1) << t;
      if (R <= 0 || R >= 1 || L->data[i] < 0.01f) continue;
      // Floats: pow of numbers near 1 is good to a few roundings.
      const double want = std::min(1.0, R * std::pow(double{L->data[i]}, t));
      ASSERT_NEAR(lit->data[i], want, 1e-5 * std::max(1.0, want)) << t;
      ++compared;
    }
    EXPECT_GT(compared, 100) << t;
  }
}

TEST(Scene, ExposureMultipliesLinearLight) {
  const auto scene = MakeScene(SmallModel(), RingViews(5));
  for (const Channel channel : {Channel::kColor, Channel::kOriginal, Channel::kLight}) {
    const auto before = RenderChannel(*scene, channel, channel == Channel::kLight ? 0.5 : 0);
    for (const double stops : {-10.0, -1.0, 1.5, 10.0}) {
      const auto after =
          RenderChannel(*scene, channel, channel == Channel::kLight ? 0.5 : 0, stops);
      ASSERT_TRUE(before.ok() && after.ok()) << after.status();
      for (size_t i = 0; i < after->data.size(); ++i) {
        if (before->data[i] >= 1) continue;  // it was cut, so nobody knows
        const double light = std::exp2(stops) * LinearFromSrgb(before->data[i]);
        ASSERT_NEAR(after->data[i], std::min(1.0, SrgbFromLinear(light)), 1e-5);
      }
    }
  }
}

// The ring's cameras are sqrt(20) from the middle of a cloud with corners at sqrt(3).
TEST(Scene, DepthIsADistanceFromTheCamera) {
  const auto depth = RenderChannel(*MakeScene(SmallModel(), RingViews(5)), Channel::kDepth);
  ASSERT_TRUE(depth.ok());
  int seen = 0;
  for (const float z : depth->data) {
    if (z == 0) continue;
    ++seen;
    EXPECT_GT(z, std::sqrt(20.0) - std::sqrt(3.0));
    EXPECT_LT(z, std::sqrt(20.0) + std::sqrt(3.0));
  }
  EXPECT_GT(seen, 50);
}

TEST(Scene, FrameLooksAtTheMiddleOfARing) {
  const auto scene = MakeScene(SmallModel(), RingViews(5));
  for (int k = 0; k < 3; ++k) EXPECT_NEAR(scene->center()[k], 0, 1e-9);
  EXPECT_NEAR(scene->up()[1], -1, 1e-9);
  EXPECT_NEAR(scene->radius(), std::sqrt(20.0), 1e-9);
}

TEST(Scene, PlainScenesHaveColorDepthAndAlphaOnly) {
  const TempDir dir;
  const auto scene = MakeScene(SmallModel(/*lita=*/false), RingViews(5));
  for (const Channel channel : {Channel::kColor, Channel::kOriginal, Channel::kAlpha}) {
    EXPECT_TRUE(RenderChannel(*scene, channel).ok()) << static_cast<int>(channel);
  }
  // In normal light, which the page asks for, it is as it was learnt.
  const auto lit = RenderChannel(*scene, Channel::kLight, /*light=*/0);
  ASSERT_TRUE(lit.ok()) << lit.status();
  EXPECT_EQ(lit->data, RenderChannel(*scene, Channel::kColor)->data);
  const auto depth = RenderChannel(*scene, Channel::kDepth);
  const auto lita = RenderChannel(*MakeScene(SmallModel(), RingViews(5)), Channel::kDepth);
  ASSERT_TRUE(depth.ok() && lita.ok());
  EXPECT_EQ(depth->data, lita->data);
  for (const Channel channel :
       {Channel::kLight, Channel::kStructure, Channel::kIllumination, Channel::kNoise}) {
    const absl::Status status = RenderChannel(*scene, channel, /*light=*/0.5).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition) << static_cast<int>(channel);
    EXPECT_EQ(Reason(status), "CHANNEL_UNAVAILABLE") << static_cast<int>(channel);
  }
  EXPECT_EQ(Reason(scene->ExportPly(dir / "a.ply", /*light=*/0.5)), "CHANNEL_UNAVAILABLE");
  EXPECT_TRUE(scene->ExportPly(dir / "a.ply", /*light=*/0).ok());
  EXPECT_TRUE(scene->ExportPly(dir / "original.ply", /*light=*/1).ok());
  EXPECT_TRUE(Bytes(dir / "a.ply") == Bytes(dir / "original.ply"));
}

TEST(Scene, WithoutTheDenoiserThereIsNoNoiseChannel) {
  Model model = SmallModel();
  model.use_pdm = false;
  const auto scene = MakeScene(std::move(model), RingViews(3));
  EXPECT_TRUE(RenderChannel(*scene, Channel::kIllumination).ok());
  EXPECT_EQ(Reason(RenderChannel(*scene, Channel::kNoise).status()), "CHANNEL_UNAVAILABLE");
}

TEST(Scene, CancelledPicturesStop) {
  const auto scene = MakeScene(SmallModel(), RingViews(3));
  RenderRequest request;
  request.camera = RingViews(3)[0].camera;
  EXPECT_TRUE(scene->Render(request).ok());
  request.cancel.Cancel();
  EXPECT_EQ(scene->Render(request).status().code(), absl::StatusCode::kCancelled);
}

TEST(Scene, APictureThatFindsNoMemoryIsAnError) {
  if (kBuiltWithSanitizer) GTEST_SKIP() << "a sanitizer needs more address space";
  const auto scene = MakeScene(SmallModel(), RingViews(3));
  RenderRequest request;
  request.threads = 1;
  request.camera = RingViews(3)[0].camera;
  request.camera.width = request.camera.height = 8000;  // 730 MiB
  const pid_t child = fork();
  if (child == 0) {
    rlimit limit;
    limit.rlim_cur = limit.rlim_max = OfThisProcess("VmSize") + (int64_t{256} << 20);
    if (setrlimit(RLIMIT_AS, &limit) != 0) _exit(2);
    _exit(Reason(scene->Render(request).status()) == "MEMORY_EXCEEDED" ? 0 : 1);
  }
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFEXITED(status)) << "signal " << WTERMSIG(status);
  EXPECT_EQ(WEXITSTATUS(status), 0);
}

TEST(Scene, BadRequestsAreRefused) {
  const auto scene = MakeScene(SmallModel(), RingViews(5));
  for (const double t : {std::nan(""), 4.01, -4.01, 1e300}) {
    EXPECT_EQ(Reason(RenderChannel(*scene, Channel::kLight, t).status()), "LIGHT_INVALID") << t;
    EXPECT_EQ(Reason(scene->ExportPly("/nonexistent/a.ply", t)), "LIGHT_INVALID") << t;
  }
  for (const double stops : {std::nan(""), 10.1, -10.1}) {
    EXPECT_EQ(Reason(RenderChannel(*scene, Channel::kColor, 0, stops).status()),
              "EXPOSURE_INVALID");
  }
  EXPECT_EQ(Reason(RenderChannel(*scene, Channel::kDepth, 0, 1).status()), "EXPOSURE_INVALID");
  RenderRequest request;
  request.camera = RingCamera(0, 5, kWidth, kHeight);
  request.camera.fx = 0;
  EXPECT_EQ(scene->Render(request).status().code(), absl::StatusCode::kInvalidArgument);
}

TEST(Scene, PlyHasColorsAfterThePicturesCurve) {
  const TempDir dir;
  const Model model = SmallModel();  // its curve: c^2
  ASSERT_TRUE(MakeScene(model, RingViews(5))->ExportPly(dir / "a.ply", 0).ok());
  const auto ply = DecodePly(Bytes(dir / "a.ply"), "ply");
  ASSERT_TRUE(ply.ok()) << ply.status();
  int compared = 0;
  for (size_t i = 0; i < model.splats.size(); ++i) {
    for (int c = 0; c < 3; ++c) {
      const double before = 0.5 + kSh0 * model.splats.at(i, kShDc + c);
      if (before < 0.02 || before > 0.98) continue;
      EXPECT_NEAR(0.5 + kSh0 * ply->splats.at(i, kShDc + c), before * before, 1e-4);
      const int row = kShRest + c;
      EXPECT_NEAR(ply->splats.at(i, row), 2 * before * model.splats.at(i, row), 0.01);
      ++compared;
    }
  }
  EXPECT_GT(compared, 50);
}

TEST(Scene, PlyInAnyLightHasTheGaussiansColorsInIt) {
  const TempDir dir;
  Model model = SmallModel();
  model.curve.reset();
  const auto scene = MakeScene(model, RingViews(5));
  ASSERT_TRUE(scene->ExportPly(dir / "normal.ply", 0).ok());
  const auto normal = DecodePly(Bytes(dir / "normal.ply"), "ply");
  ASSERT_TRUE(normal.ok()) << normal.status();
  EXPECT_FALSE(normal->lita_attributes);
  for (const double t : {-1.0, 0.5, 1.0, 4.0}) {
    ASSERT_TRUE(scene->ExportPly(dir / "lit.ply", t).ok());
    const auto lit = DecodePly(Bytes(dir / "lit.ply"), "ply");
    ASSERT_TRUE(lit.ok()) << lit.status();
    ASSERT_EQ(lit->splats.size(), model.splats.size());
    for (size_t i = 0; i < model.splats.size(); ++i) {
      for (int c = 0; c < 3; ++c) {
        EXPECT_EQ(normal->splats.at(i, kShDc + c), model.splats.at(i, kShDc + c));
        const double light = std::pow(double{model.splats.at(i, kIllumination + c)}, t);
        const double before = 0.5f + kSh0 * normal->splats.at(i, kShDc + c);
        const double after = 0.5f + kSh0 * lit->splats.at(i, kShDc + c);
        // A few roundings of numbers near 1.
        EXPECT_NEAR(after, before * light, 2e-6 * std::max(1.0, light));
        EXPECT_NEAR(lit->splats.at(i, kShRest + c), light * model.splats.at(i, kShRest + c),
                    2e-6 * std::max(1.0, light));
      }
    }
  }
}

}  // namespace
}  // namespace litags
