// Cameras of other programs: which file or folder is meant, and what is in it.
#ifndef LITAGS_ENGINE_IO_CAMERAS_IO_H_
#define LITAGS_ENGINE_IO_CAMERAS_IO_H_

#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "engine/io/sparse_model.h"

namespace litags {

// Whether a program names its file of cameras so: "transforms.json".
bool IsCamerasFileName(std::string_view name);

// What to read for `path`. For a folder without a COLMAP model: that of its folder sparse, or in
// it, which has most images; else its transforms.json, or the file of another program by the name
// that this gives it; else a model in another folder, or in colmap/sparse; else `path` itself.
// tests/support/camera_layouts.txt has examples.
std::string ResolveCameras(const std::string& path);

// Cameras of any program that is known, told by the text: transforms.json, OpenMVG's, Meshroom's,
// Metashape's and Bundler's with its list of photos. UNSUPPORTED_CAMERA_FILE names other programs;
// else the errors of those readers.
absl::StatusOr<SparseModel> ParseCameras(std::string_view text, std::string_view field,
                                         const PhotoSizes& sizes,
                                         PanoramaNames* panoramas = nullptr);

// Whether ParseCameras would take it, with panoramas, whatever the photos' sizes are. Returns the
// paths of the photos that it has cameras of.
absl::StatusOr<std::vector<std::string>> CheckCameras(std::string_view text,
                                                      std::string_view field);

// A file for ParseCameras or the folder of a COLMAP model, whichever `path` is;
// NO_CAMERAS_IN_FOLDER for another folder. Bundler's list of
// photos is read from beside it; `sure`: as ParseBundler has it.
absl::StatusOr<SparseModel> ReadCameras(const std::string& path, std::string_view field,
                                        const PhotoSizes& sizes, PanoramaNames* panoramas = nullptr,
                                        std::set<std::string>* sure = nullptr);
// The same with one size for all photos, if files give none.
absl::StatusOr<SparseModel> ReadCameras(const std::string& path, std::string_view field,
                                        int default_width = 0, int default_height = 0);

}  // namespace litags

#endif  // LITAGS_ENGINE_IO_CAMERAS_IO_H_
