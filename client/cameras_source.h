// Which cameras are meant by a folder.
#ifndef LITAGS_CLIENT_CAMERAS_SOURCE_H_
#define LITAGS_CLIENT_CAMERAS_SOURCE_H_

#include <filesystem>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace litags::client {

// "transforms.json, sfm_data.json, ...": files of cameras as their programs name them.
std::string CamerasFileNames();

bool IsColmapModel(const std::filesystem::path& dir);

// What is meant by `--cameras FOLDER`: as the engine's ResolveCameras, it itself, the largest of
// the models of its folder sparse, a file of cameras, or a model in another folder.
// tests/support/camera_layouts.txt has examples of both.
std::filesystem::path ResolveCameras(const std::filesystem::path& path);

struct DatasetCameras {
  std::filesystem::path used;       // empty: there are none
  std::vector<std::string> others;  // not used, as they are called in the folder
};

// The cameras of a dataset's folder `dir` whose photos are in the folder `photos` of it, by the
// ranks of docs/datasets.md. INVALID_ARGUMENT (CAMERAS_TWICE): the ranks do not tell which.
absl::StatusOr<DatasetCameras> CamerasOfDataset(const std::filesystem::path& dir,
                                                const std::string& photos);

}  // namespace litags::client

#endif  // LITAGS_CLIENT_CAMERAS_SOURCE_H_
