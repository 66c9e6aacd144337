// The layout of the LOM benchmark: SCENE/{low,over_exp,high}/ with the same photo names, and
// SCENE/transforms_{train,test}.json.
#ifndef LITAGS_ENGINE_TOOLS_EVALUATION_BENCHMARK_SCENE_H_
#define LITAGS_ENGINE_TOOLS_EVALUATION_BENCHMARK_SCENE_H_

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "engine/pipeline/engine.h"
#include "engine/tools/evaluation/test_view.h"

namespace litags {

// Test views that are not scored, by name.
struct UnscoredViews {
  std::vector<std::string> trained_on, without_camera;

  // Sentences for the user, where `scored` others are scored.
  std::vector<std::string> Notes(size_t scored) const;
};

struct BenchmarkScene {
  std::string dir;
  std::string light;       // folder of the photos to train on; empty: they are in `dir` itself
  std::string cameras;     // instead of transforms_train.json
  bool sfm = false;        // COLMAP finds the cameras, of all photos
  std::string poses = {};  // test views' cameras instead of transforms_test.json
  std::string truth = {};  // folder of normally lit photos instead of SCENE/high

  std::string PhotosDir() const;
  std::string TruthDir() const;  // `truth`, SCENE/high, or empty if there is none

  std::string DepthDir() const;  // SCENE/depth; empty with `sfm`: COLMAP's world has another unit

  // Known cameras unless `sfm`. Nothing else is held out of transforms_train.json, nor of `cameras`
  // if the scene has test views of its own.
  // INVALID_ARGUMENT: TEST_VIEW_IN_CAMERAS if `cameras` have one that is scored: its photo would be
  // trained on. POSES_WITHOUT_CAMERAS if COLMAP finds the cameras: its world is not that of
  // `poses`, nor of transforms_test.json.
  absl::StatusOr<ReconstructInput> Input(const std::string& work_dir,
                                         ReconstructOptions* options) const;

  // Whether there are `poses` or a transforms_test.json. Without a `light` nothing says that this
  // is of the world, or kept out of the photos, that the scene is trained on, unless `sfm` finds
  // both.
  bool HasTestViews() const;
  // Their cameras, at the size and way up of their truth photos; none without HasTestViews().
  // Errors of FitToPhoto.
  absl::StatusOr<std::vector<TestView>> TestViews() const;
  // With `sfm` they are the trained scene's own, by name: COLMAP's world is another. So are their
  // lenses, which the run in `work_dir` found. That run held out one photo in `holdout_every`; test
  // views that it trained on, or found no camera of, are left out and go to `unscored` (may be
  // null).
  absl::StatusOr<std::vector<TestView>> TestViews(const Scene& scene, const std::string& work_dir,
                                                  int holdout_every,
                                                  UnscoredViews* unscored = nullptr) const;
};

}  // namespace litags

#endif  // LITAGS_ENGINE_TOOLS_EVALUATION_BENCHMARK_SCENE_H_
