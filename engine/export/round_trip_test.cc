// What is written is what was there, as exactly as each format can.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "engine/core/error_test_util.h"
#include "engine/export/export_test_util.h"
#include "engine/export/formats.h"
#include "engine/export/readers.h"
#include "engine/viewer/viewer.h"

namespace litags {
namespace {

constexpr size_t kCount = 700;  // no multiple of a chunk

// What a format may lose at most.
struct Limits {
  SceneFormat format;
  Errors errors;
  double psnr_db;
};

// Half a step of each format's numbers, with the scene's sizes.
const Limits kLimits[] = {
    {SceneFormat::kPly, {0, 0, 1e-6, 0, 0, 0}, 100},
    // 2 / 1024 in a chunk of size 2; 9 bits of sqrt 2; 8 / 256.
    {SceneFormat::kCompressedPly, {1.1e-3, 6e-4, 8e-3, 2.1e-3, 3e-3, 0.017}, 34},
    {SceneFormat::kSpz, {1.3e-4, 0.032, 5e-3, 2.1e-3, 4e-3, 0.064}, 26},
    {SceneFormat::kSpzV4, {1.3e-4, 0.032, 5e-3, 2.1e-3, 4e-3, 0.064}, 26},
    {SceneFormat::kSog, {6e-5, 0.01, 0.025, 2.1e-3, 6e-3, 0.01}, 34},
    {SceneFormat::kGlb, {0, 1e-6, 1e-6, 1e-6, 0, 0}, 70},
    {SceneFormat::kUsda, {0, 1e-5, 1e-5, 1e-5, 1e-5, 1e-6}, 70},
};

std::string Encoded(SceneFormat format, const ViewerScene& scene) {
  const auto bytes = InfoOf(format).encode(scene);
  EXPECT_TRUE(bytes.ok()) << InfoOf(format).name << ": " << bytes.status();
  return bytes.value_or("");
}

// All, but for pages where the viewer was not built.
std::vector<FormatInfo> BuiltFormats() {
  std::vector<FormatInfo> built;
  for (const FormatInfo& info : Formats()) {
    if (info.format != SceneFormat::kHtml || !ViewerModule().empty()) built.push_back(info);
  }
  return built;
}

TEST(RoundTrip, LosesNoMoreThanTheFormatMust) {
  const ViewerScene scene = SmallScene(kCount);
  for (const Limits& limits : kLimits) {
    SCOPED_TRACE(InfoOf(limits.format).name);
    const auto read = ReadExported(limits.format, Encoded(limits.format, scene));
    ASSERT_TRUE(read.ok()) << read.status();
    EXPECT_EQ(read->sh_degree, 3);
    const Errors errors = ErrorsOf(scene.splats, read->splats);
    EXPECT_LE(errors.position, limits.errors.position);
    EXPECT_LE(errors.log_scale, limits.errors.log_scale);
    EXPECT_LE(errors.angle, limits.errors.angle);
    EXPECT_LE(errors.opacity, limits.errors.opacity);
    EXPECT_LE(errors.color, limits.errors.color);
    EXPECT_LE(errors.harmonics, limits.errors.harmonics);
    EXPECT_GT(LeastPsnr(scene, read->splats), limits.psnr_db);
  }
}

TEST(RoundTrip, APageHoldsTheCompressedPlyAndTheCameras) {
  ViewerScene scene = SmallScene(kCount);
  scene.views[0].name = "</script><b>\xff.png";
  scene.radius = 2.5;
  scene.origin = {500000, 4000000, 20};
  const auto page = InfoOf(SceneFormat::kHtml).encode(scene);
  if (ViewerModule().empty()) {
    EXPECT_EQ(Reason(page.status()), "EXPORT_NOT_BUILT");
    GTEST_SKIP() << "built without the viewer";
  }
  ASSERT_TRUE(page.ok()) << page.status();
  const auto read = ReadExported(SceneFormat::kHtml, *page);
  ASSERT_TRUE(read.ok()) << read.status();
  const auto ply =
      ReadExported(SceneFormat::kCompressedPly, Encoded(SceneFormat::kCompressedPly, scene));
  ASSERT_TRUE(ply.ok()) << ply.status();
  EXPECT_TRUE(read->splats.data() == ply->splats.data());
  // Three scripts, which no name ends; the cameras as the page reads them.
  size_t ends = 0;
  for (size_t at = page->find("</script>"); at != page->npos;
       at = page->find("</script>", at + 1)) {
    ++ends;
  }
  EXPECT_EQ(ends, 3u);
  const std::string start = "id=\"cameras\">";
  const size_t from = page->find(start) + start.size();
  const auto cameras =
      nlohmann::json::parse(page->substr(from, page->find("</script>", from) - from));
  EXPECT_EQ(cameras["radius"], 2.5);
  ASSERT_EQ(cameras["cameras"].size(), scene.views.size());
  EXPECT_EQ(cameras["cameras"][1]["camera"]["viewmat"]["values"],
            nlohmann::json(scene.views[1].camera.Moved(scene.origin).Viewmat()));
  EXPECT_EQ(cameras["center"]["y"], scene.center[1] + 4000000);
}

// As where a training run lost one: its order then says little, as the box of all of them is huge.
TEST(RoundTrip, NeighboursShareAChunkHoweverFarAGaussianIs) {
  const size_t count = 20000;
  const ViewerScene near = SmallScene(count);
  ViewerScene scene = near;
  scene.splats.Resize(count + 1);
  for (size_t i = 0; i < count; ++i) scene.splats.Copy(near.splats, 1009 * i % count, i);
  scene.splats.Copy(near.splats, 0, count);
  scene.splats.at(count, kMean) = 1e7f;
  const std::vector<uint32_t> order = NearOrder(scene.splats);
  const auto read =
      ReadExported(SceneFormat::kCompressedPly, Encoded(SceneFormat::kCompressedPly, scene));
  ASSERT_TRUE(read.ok()) << read.status();
  ASSERT_EQ(read->splats.size(), count + 1);
  constexpr double kStep = 2.0 / 1024;  // of a chunk as large as the scene
  size_t coarse = 0;
  for (size_t i = 0; i <= count; ++i) {
    const auto error = [&](int k) {
      return std::abs(read->splats.at(i, kMean + k) - scene.splats.at(order[i], kMean + k));
    };
    coarse += std::max({error(0), error(1), error(2)}) > kStep / 4;
  }
  EXPECT_LT(coarse, count / 5);
}

TEST(RoundTrip, SplatsComeMostVisibleFirstWithOneColour) {
  ViewerScene scene = SmallScene(kCount, /*sh_degree=*/0);
  const auto read = ReadExported(SceneFormat::kSplat, Encoded(SceneFormat::kSplat, scene));
  ASSERT_TRUE(read.ok()) << read.status();
  ASSERT_EQ(read->splats.size(), kCount);
  double last = 1e9;
  for (size_t i = 0; i < kCount; ++i) {
    double visible = std::log(Opacity(read->splats, i));
    for (int k = 0; k < 3; ++k) visible += read->splats.at(i, kLogScale + k);
    EXPECT_LE(visible, last + 0.02) << i;  // opacities are in bytes
    last = visible;
  }
  EXPECT_GT(LeastPsnr(scene, read->splats), 30);
}

TEST(RoundTrip, LowerDegreesAreWrittenAsSuch) {
  for (int degree = 0; degree < 3; ++degree) {
    const ViewerScene scene = SmallScene(50, degree);
    const ViewerScene higher = SmallScene(50);
    for (const Limits& limits : kLimits) {
      if (limits.format == SceneFormat::kPly) continue;  // viewers expect all of it
      SCOPED_TRACE(InfoOf(limits.format).name);
      const std::string bytes = Encoded(limits.format, scene);
      const auto read = ReadExported(limits.format, bytes);
      ASSERT_TRUE(read.ok()) << read.status();
      EXPECT_EQ(read->sh_degree, degree);
      EXPECT_LE(ErrorsOf(scene.splats, read->splats).harmonics, limits.errors.harmonics);
      EXPECT_LT(bytes.size(), Encoded(limits.format, higher).size());
    }
  }
}

TEST(RoundTrip, TheAntialiasedTagIsKeptWhereTheFormatHasOne) {
  ViewerScene scene = SmallScene(20);
  for (const bool antialiased : {false, true}) {
    scene.antialiased = antialiased;
    for (const FormatInfo& info : BuiltFormats()) {
      if (!info.has_antialiased_tag) continue;
      const auto read = ReadExported(info.format, Encoded(info.format, scene));
      ASSERT_TRUE(read.ok()) << read.status();
      EXPECT_EQ(read->antialiased, antialiased) << info.name;
    }
  }
}

TEST(RoundTrip, OneGaussianAndExtremeOnesCanBeWritten) {
  for (size_t count : {1, 300}) {
    ViewerScene scene = SmallScene(count);
    for (int k = 0; k < 3; ++k) {
      scene.splats.at(0, kLogScale + k) = -60;
      scene.splats.at(0, kShDc + k) = 400;
      scene.splats.at(0, kShRest + k) = -30;
    }
    scene.splats.at(0, kLogitOpacity) = 90;
    for (int k = 0; k < 4; ++k) scene.splats.at(0, kRawQuat + k) = 0;
    for (const FormatInfo& info : BuiltFormats()) {
      if (info.format == SceneFormat::kColmap) continue;
      if (count == 1 && std::string(info.name).starts_with("spz")) continue;  // all are too small
      const auto read = ReadExported(info.format, Encoded(info.format, scene));
      ASSERT_TRUE(read.ok()) << info.name << ": " << read.status();
      ASSERT_EQ(read->splats.size(), count) << info.name;
      for (size_t i = 0; i < count; ++i) {
        for (int k = 0; k < 3; ++k) {
          EXPECT_TRUE(std::isfinite(read->splats.at(i, kMean + k))) << info.name;
        }
      }
    }
  }
}

TEST(RoundTrip, SpzTakesFewerBitsForFarGaussiansAndRefusesWhatItCannotHold) {
  ViewerScene scene = SmallScene(10);
  scene.splats.at(3, kMean) = -100000;
  const auto far = ReadExported(SceneFormat::kSpz, Encoded(SceneFormat::kSpz, scene));
  ASSERT_TRUE(far.ok()) << far.status();
  EXPECT_LE(ErrorsOf(scene.splats, far->splats).position, 0.5 / 64);
  scene.splats.at(3, kMean) = 600000;
  for (SceneFormat format : {SceneFormat::kSpz, SceneFormat::kSpzV4}) {
    const auto refused = InfoOf(format).encode(scene);
    EXPECT_EQ(Reason(refused.status()), "EXPORT_OUT_OF_RANGE");
  }
}

// As a --scale or the unit of the cameras makes it.
void Rescale(double factor, Splats* splats) {
  for (size_t i = 0; i < splats->size(); ++i) {
    for (int k = 0; k < 3; ++k) {
      splats->at(i, kMean + k) *= static_cast<float>(factor);
      splats->at(i, kLogScale + k) += static_cast<float>(std::log(factor));
    }
  }
}

double NumberAfter(const std::string& before, const absl::Status& status) {
  const std::string message(status.message());
  const size_t at = message.find(before);
  EXPECT_NE(at, message.npos) << message;
  return at == message.npos ? 0 : std::atof(message.c_str() + at + before.size());
}

TEST(RoundTrip, SpzTakesMoreBitsForSmallScenesAndRefusesTooSmallOnes) {
  const double kSmall = 0.001;
  ViewerScene scene = SmallScene(kCount);
  Rescale(kSmall, &scene.splats);
  for (SceneFormat format : {SceneFormat::kSpz, SceneFormat::kSpzV4}) {
    const auto read = ReadExported(format, Encoded(format, scene));
    ASSERT_TRUE(read.ok()) << read.status();
    const Errors errors = ErrorsOf(scene.splats, read->splats);
    // Sizes are 5e-5 and larger: half a step is a sixteenth of the median's at most.
    EXPECT_LE(errors.position, kSmall * 0.1 / 16);
    EXPECT_LE(errors.log_scale, 0.032);
  }
  // One in ten may grow.
  for (size_t i = 0; i < kCount / 10; ++i) {
    for (int k = 0; k < 3; ++k) scene.splats.at(i, kLogScale + k) = -14;
  }
  EXPECT_TRUE(InfoOf(SceneFormat::kSpz).encode(scene).ok());
  Rescale(0.1, &scene.splats);
  const auto refused = InfoOf(SceneFormat::kSpz).encode(scene).status();
  EXPECT_EQ(Reason(refused), "EXPORT_OUT_OF_RANGE");
  // What it asks for will do.
  Rescale(NumberAfter("a scale at least ", refused), &scene.splats);
  EXPECT_TRUE(InfoOf(SceneFormat::kSpz).encode(scene).ok()) << refused;
}

TEST(RoundTrip, SpzRefusesTooLargeScenes) {
  ViewerScene scene = SmallScene(kCount);
  // One in ten may shrink.
  for (size_t i = 0; i < kCount / 10; ++i) scene.splats.at(i, kLogScale + 1) = 6.5f;
  EXPECT_TRUE(InfoOf(SceneFormat::kSpz).encode(scene).ok());
  scene.splats.at(kCount / 10, kLogScale) = 6.2f;
  for (SceneFormat format : {SceneFormat::kSpz, SceneFormat::kSpzV4}) {
    const auto refused = InfoOf(format).encode(scene).status();
    ASSERT_EQ(Reason(refused), "EXPORT_OUT_OF_RANGE");
    ViewerScene smaller = scene;
    Rescale(NumberAfter("a scale at most ", refused), &smaller.splats);
    EXPECT_TRUE(InfoOf(format).encode(smaller).ok()) << refused;
  }
}

TEST(RoundTrip, SpzRefusesMoreGaussiansThanItsReadersTake) {
  EXPECT_TRUE(CheckSpzCount(10000000).ok());
  const absl::Status refused = CheckSpzCount(10000001);
  EXPECT_EQ(Reason(refused), "EXPORT_OUT_OF_RANGE");
  EXPECT_EQ(NumberAfter("take at most ", refused), 10000000);
}

TEST(RoundTrip, GlbShowsProgramsOfPointsLinearColors) {
  ViewerScene scene = SmallScene(3, /*sh_degree=*/0);
  for (int k = 0; k < 3; ++k) {
    scene.splats.at(1, kShDc + k) = static_cast<float>((k / 2.0 - 0.5) / kSh0);  // 0, 0.5, 1
    scene.splats.at(2, kShDc + k) = k == 0 ? -9.0f : 9.0f;
  }
  const auto [gltf, binary] = PartsOf(Encoded(SceneFormat::kGlb, scene));
  const auto& attributes = gltf["meshes"][0]["primitives"][0]["attributes"];
  const auto& color = gltf["accessors"][attributes["COLOR_0"].get<int>()];
  EXPECT_EQ(color["componentType"], 5123);  // UNSIGNED_SHORT
  EXPECT_EQ(color["type"], "VEC4");
  EXPECT_EQ(color["normalized"], true);
  const size_t at = gltf["bufferViews"][color["bufferView"].get<int>()]["byteOffset"];
  const auto code = [&](size_t i, size_t k) {
    return NumberAt<uint16_t>(binary, at + 2 * (4 * i + k));
  };
  EXPECT_EQ(code(1, 0), 0);
  EXPECT_EQ(code(1, 1),
            std::lround(65535 * 0.2140411));  // half of the codes is a fifth of the light
  EXPECT_EQ(code(1, 2), 65535);
  EXPECT_EQ(code(1, 3), std::lround(65535 * Opacity(scene.splats, 1)));
  EXPECT_EQ(code(2, 0), 0);
  EXPECT_EQ(code(2, 1), 65535);
}

TEST(RoundTrip, ColmapHoldsCamerasAndCoordinatesOfTheUser) {
  ViewerScene scene = SmallScene(40);
  scene.origin = {500000, 4000000, 20};
  const auto model = ReadExportedColmap(Encoded(SceneFormat::kColmap, scene));
  ASSERT_TRUE(model.ok()) << model.status();
  ASSERT_EQ(model->views.size(), scene.views.size());
  for (size_t v = 0; v < model->views.size(); ++v) {
    EXPECT_EQ(model->views[v].name, scene.views[v].name);
    const auto got = model->views[v].camera.Center(), want = scene.views[v].camera.Center();
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(got[k], want[k] + scene.origin[k], 1e-6);
    EXPECT_EQ(model->views[v].camera.fx, scene.views[v].camera.fx);
  }
  ASSERT_EQ(model->points.size(), 40u);
  for (size_t i = 0; i < 40; ++i) {
    for (int k = 0; k < 3; ++k) {
      EXPECT_NEAR(model->points[i].xyz[k], scene.splats.at(i, kMean + k) + scene.origin[k], 1e-6);
    }
  }
}

TEST(RoundTrip, TheSameSceneGivesTheSameBytes) {
  const ViewerScene scene = SmallScene(300);
  for (const FormatInfo& info : BuiltFormats()) {
    EXPECT_TRUE(Encoded(info.format, scene) == Encoded(info.format, scene)) << info.name;
  }
}

TEST(RoundTrip, MapCoordinatesStandInFormatsThatHaveAPlaceForThem) {
  ViewerScene scene = SmallScene(5);
  scene.origin = {500000, 4000000.25, 20};
  const auto glb = ReadExported(SceneFormat::kGlb, Encoded(SceneFormat::kGlb, scene));
  ASSERT_TRUE(glb.ok()) << glb.status();
  EXPECT_EQ(glb->origin, scene.origin);
  const auto compressed =
      ReadExported(SceneFormat::kCompressedPly, Encoded(SceneFormat::kCompressedPly, scene));
  ASSERT_TRUE(compressed.ok()) << compressed.status();
  EXPECT_EQ(compressed->origin, scene.origin);
  EXPECT_NE(Encoded(SceneFormat::kUsda, scene).find("(500000, 4000000.25, 20)"), std::string::npos);
  EXPECT_NE(Encoded(SceneFormat::kPly, scene).find("comment origin 500000 4000000.25 20\n"),
            std::string::npos);
}

TEST(RoundTrip, BrokenFilesAreRefused) {
  const ViewerScene scene = SmallScene(40);
  for (const FormatInfo& info : BuiltFormats()) {
    if (info.format == SceneFormat::kColmap) continue;
    const std::string bytes = Encoded(info.format, scene);
    EXPECT_FALSE(ReadExported(info.format, bytes.substr(0, bytes.size() / 2 + 3)).ok())
        << info.name;
  }
}

}  // namespace
}  // namespace litags
