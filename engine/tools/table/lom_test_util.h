// For tests: a small sample capture as LOM is downloaded, taken through a lens with distortion.
#ifndef LITAGS_ENGINE_TOOLS_TABLE_LOM_TEST_UTIL_H_
#define LITAGS_ENGINE_TOOLS_TABLE_LOM_TEST_UTIL_H_

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "engine/io/cameras_io.h"
#include "engine/io/colmap_io.h"
#include "engine/io/depth_io.h"
#include "engine/io/file_util.h"
#include "engine/io/image_io.h"
#include "engine/io/sparse_model.h"
#include "engine/io/transforms_io.h"
#include "engine/sample/capture.h"
#include "engine/tools/evaluation/distort_test_util.h"

namespace litags {

// Moves the pinhole camera's pixel (x, y), seen at `depth`, to the world.
inline std::array<double, 3> WorldPoint(const Camera& c, double x, double y, double depth) {
  const double p[3] = {(x - c.cx) / c.fx * depth - c.t[0], (y - c.cy) / c.fy * depth - c.t[1],
                       depth - c.t[2]};
  std::array<double, 3> world;
  for (int i = 0; i < 3; ++i) world[i] = c.R[i] * p[0] + c.R[3 + i] * p[1] + c.R[6 + i] * p[2];
  return world;
}

// Writes SCENE/{low,high,over_exp}, transforms_{train,test}.json with k1 k2 p1 p2, and
// SCENE/sparse, a COLMAP model with points of exact depth so that no COLMAP is needed. Views 2 and
// 6 of 8 are the test views.
inline void WriteLomScene(const std::string& dir, int width = 64, int height = 48) {
  sample::CaptureOptions options;
  options.width = width;
  options.height = height;
  options.views = 8;
  options.test_every = 4;
  options.antialias = 1;
  options.threads = 1;
  options.truth = true;
  ASSERT_TRUE(sample::WriteCapture(options, dir).ok());

  const Distortion lens{.k1 = -0.08, .k2 = 0.01, .p1 = 0.002, .p2 = -0.001};
  SparseModel all;
  for (const char* part : {"train", "test"}) {
    const std::string path = dir + "/transforms_" + part + ".json";
    auto model = ReadCameras(path, part);
    ASSERT_TRUE(model.ok()) << model.status();
    for (size_t i = 0; i < model->views.size(); ++i) {
      model->distortions[i] = lens;
      const View& view = model->views[i];
      for (const char* light : {"low", "high", "over_exp"}) {
        const std::string photo = dir + "/" + light + "/" + view.name;
        const auto picture = ReadImage(photo, light);
        ASSERT_TRUE(picture.ok()) << picture.status();
        ASSERT_TRUE(WriteJpeg(photo, DistortPicture(*picture, view.camera, lens)).ok());
      }
      const int index = static_cast<int>(all.views.size());
      all.views.push_back(view);
      all.distortions.push_back(lens);
      if (std::string(part) == "test") continue;
      const auto depth = ReadDepthMap(dir + "/depth/" + Stem(view.name) + ".pfm", "depth");
      ASSERT_TRUE(depth.ok()) << depth.status();
      for (int y = 4; y < height; y += 8) {
        for (int x = 4; x < width; x += 8) {
          SparsePoint point;
          point.xyz = WorldPoint(view.camera, x + 0.5, y + 0.5, depth->at(0, y, x));
          point.rgb = {30, 30, 30};
          // Where it was seen matters to nobody here.
          point.track = {{index, x + 0.5, y + 0.5}};
          if (index > 0) point.track.push_back({index - 1, x + 0.5, y + 0.5});
          all.points.push_back(std::move(point));
        }
      }
    }
    ASSERT_TRUE(WriteTransforms(path, *model, "low").ok());
  }
  std::filesystem::create_directories(dir + "/sparse");
  ASSERT_TRUE(WriteColmapModel(dir + "/sparse", all).ok());
}

// Leaves of a scene what a photographer brings home from real darkness: no dark photo of the test
// views, and in high/ no photo but theirs, or none at all (`truth` false).
inline void LeaveInTheDark(const std::string& scene, bool truth) {
  const auto test = ReadCameras(scene + "/transforms_test.json", "test");
  const auto train = ReadCameras(scene + "/transforms_train.json", "train");
  ASSERT_TRUE(test.ok() && train.ok());
  for (const View& view : test->views) std::filesystem::remove(scene + "/low/" + view.name);
  for (const View& view : train->views) std::filesystem::remove(scene + "/high/" + view.name);
  std::filesystem::remove_all(scene + "/over_exp");
  if (!truth) std::filesystem::remove_all(scene + "/high");
}

// Writes SCENE/sparse without the test views, cameras that need no COLMAP.
inline void WriteTrainingCameras(const std::string& scene, const std::string& out) {
  auto model = ReadColmapModel(scene + "/sparse", "sparse");
  ASSERT_TRUE(model.ok()) << model.status();
  const auto test = ReadCameras(scene + "/transforms_test.json", "test");
  ASSERT_TRUE(test.ok()) << test.status();
  std::vector<int> to(model->views.size(), -1);
  SparseModel kept;
  for (size_t i = 0; i < model->views.size(); ++i) {
    const std::string& name = model->views[i].name;
    const auto same = [&](const View& view) { return view.name == name; };
    if (std::any_of(test->views.begin(), test->views.end(), same)) continue;
    to[i] = static_cast<int>(kept.views.size());
    kept.views.push_back(model->views[i]);
    kept.distortions.push_back(model->distortions[i]);
  }
  kept.points = std::move(model->points);
  for (SparsePoint& point : kept.points) {
    std::erase_if(point.track, [&](const TrackElement& e) { return to[e.view] < 0; });
    for (TrackElement& e : point.track) e.view = to[e.view];
  }
  std::filesystem::create_directories(out);
  ASSERT_TRUE(WriteColmapModel(out, kept).ok());
}

}  // namespace litags

#endif  // LITAGS_ENGINE_TOOLS_TABLE_LOM_TEST_UTIL_H_
