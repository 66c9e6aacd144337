// Scenes of the table: folders in the layout of the LOM benchmark.
#ifndef LITAGS_ENGINE_TOOLS_TABLE_SCENE_H_
#define LITAGS_ENGINE_TOOLS_TABLE_SCENE_H_

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "engine/pipeline/options.h"
#include "engine/tools/evaluation/test_view.h"

namespace litags {

struct TableScene {
  std::string name;    // of the folder
  std::string dir;     // holds low/, over_exp/, high/ and transforms_{train,test}.json
  std::string sparse;  // path inside it to cameras used instead of transforms_train.json, or empty

  std::string PhotosDir(const std::string& light) const { return dir + "/" + light; }
  std::string TruthDir() const { return PhotosDir("high"); }

  // The views named in transforms_test.json, with their cameras from there or from `sparse`, at
  // the size of the truth photos. NOT_FOUND if there are none.
  absl::StatusOr<std::vector<TestView>> TestViews() const;

  // Photos of this light that are not test views, by name.
  absl::StatusOr<std::vector<std::string>> TrainingPhotos(const std::string& light) const;

  // A COLMAP model of the training photos: known cameras, points triangulated from the photos of
  // this light (unless `sparse` has points), kept in `work_dir`. Returns its folder. The photos'
  // masks, wherever litags-train would find them, are copied into `work_dir`/masks; without any
  // there is no such folder.
  absl::StatusOr<std::string> PrepareCameras(const std::string& light,
                                             const ReconstructOptions& options,
                                             const std::string& colmap,
                                             const std::string& work_dir) const;
};

// The scenes in `dirs`: each is one, or a folder of scenes such as LOM_full. NOT_FOUND for a folder
// that is neither; INVALID_ARGUMENT if two scenes have one name.
absl::StatusOr<std::vector<TableScene>> FindScenes(const std::vector<std::string>& dirs,
                                                   const std::string& sparse);

}  // namespace litags

#endif  // LITAGS_ENGINE_TOOLS_TABLE_SCENE_H_
