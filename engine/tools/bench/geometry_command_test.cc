// Runs `litags-bench geometry` on a wall whose place is known.
#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "engine/core/image.h"
#include "engine/core/temp_dir_test_util.h"
#include "engine/io/depth_io.h"
#include "engine/io/test_util.h"
#include "engine/pipeline/scene_file.h"
#include "engine/pipeline/wall_test_util.h"
#include "engine/tools/bench/run_bench_test_util.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace litags {
namespace {

using ::testing::HasSubstr;

// What the command finds where the truth says that the wall is at `depth`.
nlohmann::json Measured(const TempDir& dir, double depth) {
  EXPECT_TRUE(SaveScene(dir / "scene.litags", WallModel(), WallViews()).ok());
  for (const View& view : WallViews()) {
    Planes map(1, view.camera.height, view.camera.width);
    std::fill(map.data.begin(), map.data.end(), static_cast<float>(depth));
    EXPECT_TRUE(WritePfm(dir / (view.name.substr(0, view.name.find('.')) + ".pfm"), map).ok());
  }
  const SubprocessResult result = RunBench(
      "geometry",
      {dir / "scene.litags", dir.path(), "--json", dir / "report.json", "--out", dir / "files"});
  EXPECT_EQ(result.exit_code, 0) << result.tail;
  return nlohmann::json::parse(std::ifstream(dir / "report.json"), nullptr, false);
}

TEST(GeometryCommand, FindsHowFarTheWallIsOff) {
  for (const double off : {0.0, 0.1}) {
    const TempDir dir;
    const nlohmann::json report = Measured(dir, kWallDepth + off);
    for (const char* surface : {"points", "mesh"}) {
      const auto& found = report.at(surface);
      EXPECT_NEAR(found["accuracy"]["median"].get<double>(), off, 0.01) << surface;
      EXPECT_NEAR(found["accuracy"]["median_of_depth"].get<double>(), off / (kWallDepth + off),
                  0.002)
          << surface;
      EXPECT_GT(found["completeness"]["ninety"].get<double>(), off - 0.01) << surface;
    }
    for (const char* file : {"scene.points.ply", "scene.las", "scene.mesh.ply", "scene.mesh.glb"}) {
      EXPECT_GT(Bytes(dir / ("files/" + std::string(file))).size(), 1000u) << file;
    }
  }
}

TEST(GeometryCommand, WithoutTruthSaysWhereItComesFrom) {
  const TempDir dir;
  ASSERT_TRUE(SaveScene(dir / "scene.litags", WallModel(), WallViews()).ok());
  const SubprocessResult result = RunBench("geometry", {dir / "scene.litags", dir.path()});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.tail, HasSubstr("litags-sample --truth"));
}

}  // namespace
}  // namespace litags
