#include "engine/io/cameras_io.h"

#include <algorithm>
#include <filesystem>
#include <vector>

#include "engine/io/colmap_io.h"

namespace litags {
namespace {

namespace fs = std::filesystem;

bool IsColmapModel(const fs::path& dir) {
  std::error_code ignored;
  return fs::exists(dir / "cameras.bin", ignored) || fs::exists(dir / "cameras.txt", ignored);
}

// The COLMAP models in the folders of `dir` and in its folder sparse, by name.
std::vector<fs::path> ModelsIn(const fs::path& dir) {
  std::vector<fs::path> found;
  for (const fs::path& parent : {dir, dir / "sparse"}) {
    std::error_code ignored;
    for (const auto& entry : fs::directory_iterator(parent, ignored)) {
      if (IsColmapModel(entry.path())) found.push_back(entry.path());
    }
  }
  std::sort(found.begin(), found.end());
  return found;
}

}  // namespace

std::string ResolveCameras(const std::string& path) {
  std::error_code ignored;
  if (!fs::is_directory(path, ignored) || IsColmapModel(path)) return path;
  std::string best;
  size_t most = 0;
  for (const fs::path& dir : ModelsIn(path)) {
    const auto model = ReadColmapModel(dir, "cameras");
    const size_t views = model.ok() ? model->views.size() : 0;
    if (!best.empty() && views <= most) continue;
    best = dir;
    most = views;
  }
  if (!best.empty()) return best;
  const fs::path json = fs::path(path) / "transforms.json";
  return fs::is_regular_file(json, ignored) ? json.string() : path;
}

absl::StatusOr<SparseModel> ReadCamerasOf(const std::string& resolved, std::string_view field,
                                          const PhotoSizes& sizes, PanoramaNames* panoramas) {
  std::error_code ignored;
  if (fs::is_directory(resolved, ignored)) return ReadColmapModel(resolved, field);
  return ReadTransforms(resolved, field, sizes, panoramas);
}

}  // namespace litags
