// What else lies in a folder of photos: the user may mean to have it used.
#ifndef LITAGS_ENGINE_TOOLS_INSPECT_FOLDER_CONTENTS_H_
#define LITAGS_ENGINE_TOOLS_INSPECT_FOLDER_CONTENTS_H_

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "engine/pipeline/engine.h"

namespace litags {

// cameras, images and points3D of COLMAP, whatever the ending.
bool IsModelFile(const std::string& name);

// Names of the folders in `dir` that hold photos, sorted; not masks.
std::vector<std::string> FoldersOfPhotos(const std::string& dir);

// That a run finds photos in the folder. Errors of ListPhotos, naming the folders inside that hold
// some.
absl::Status CheckHoldsPhotos(const std::string& dir);

// Notes on what a run does not read, as it is no photo or lies in a folder within: "3 photos in
// sub/ are not used". Masks, cameras and depth maps that the run reads are not named.
std::vector<std::string> DescribeUnused(const ReconstructInput& input);

}  // namespace litags

#endif  // LITAGS_ENGINE_TOOLS_INSPECT_FOLDER_CONTENTS_H_
