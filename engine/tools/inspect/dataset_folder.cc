#include "engine/tools/inspect/dataset_folder.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <initializer_list>
#include <optional>
#include <system_error>
#include <utility>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/io/cameras_io.h"
#include "engine/io/dataset_layout.h"
#include "engine/io/file_util.h"
#include "engine/io/image_io.h"
#include "engine/tools/inspect/folder_contents.h"
#include "proto/arguments/arguments.h"

namespace litags {
namespace {

namespace fs = std::filesystem;
using Kind = DatasetFile::Kind;

struct DatasetFolder {
  std::string photos, cameras, masks, depth;  // empty: not there
  bool cameras_are_ambiguous = false;
  std::vector<std::string> notes;
};

// "colmap/sparse/0/images.bin" is the deepest that is meant.
constexpr int kMostFolders = 3;

Kind KindOf(const std::string& folder, const std::string& name) {
  const std::string ending = fs::path(name).extension();
  // Text of these names may be anything, save where COLMAP's is.
  const bool colmap = absl::StrContains(folder, "sparse") || absl::StrContains(folder, "colmap");
  if (IsModelFile(name) && (ending == ".bin" || (ending == ".txt" && colmap))) return Kind::kModel;
  if (IsCamerasFileName(name)) return Kind::kCameras;
  return IsPhotoName(name) ? Kind::kPhoto : Kind::kOther;
}

// None if `dir` is no folder. A folder in it that may not be read is left out.
absl::StatusOr<std::vector<DatasetFile>> FilesIn(const fs::path& dir) {
  std::vector<DatasetFile> files;
  std::error_code error, ignored;
  if (!fs::is_directory(dir, ignored)) return files;
  fs::recursive_directory_iterator it(dir, fs::directory_options::skip_permission_denied, error);
  for (const fs::recursive_directory_iterator end; !error && it != end; it.increment(error)) {
    const std::string name = it->path().filename();
    if (name.starts_with('.') || it.depth() == kMostFolders) it.disable_recursion_pending();
    if (name.starts_with('.') || !it->is_regular_file(ignored)) continue;
    DatasetFile file{it->path().parent_path().lexically_relative(dir), name};
    if (file.folder == ".") file.folder.clear();
    file.kind = KindOf(file.folder, name);
    if (file.kind == Kind::kModel) file.bytes = static_cast<int64_t>(it->file_size(ignored));
    files.push_back(std::move(file));
  }
  if (error) {
    return MakeError(
        absl::StatusCode::kInternal, "IO_ERROR", "dir",
        absl::StrCat("cannot list the folder '", dir.string(), "': ", error.message()));
  }
  // The order of a folder's files is the disk's.
  std::sort(files.begin(), files.end(),
            [](const DatasetFile& a, const DatasetFile& b) { return a.Path() < b.Path(); });
  return files;
}

// The first of these folders that is there, or "".
std::string FolderIn(const fs::path& dir, std::initializer_list<const char*> names) {
  std::error_code ignored;
  for (const char* name : names) {
    if (fs::is_directory(dir / name, ignored)) return dir / name;
  }
  return "";
}

// Whether one of its files ends as those that FindDepthMap looks for.
bool HoldsDepthMaps(const std::string& dir) {
  const auto maps = ListFiles(dir, "depth", [](const std::string& name) {
    const std::string ending = fs::path(name).extension();
    return ending == ".png" || ending == ".pfm" || ending == ".npy";
  });
  return maps.ok() && !maps->empty();
}

absl::StatusOr<std::optional<DatasetFolder>> ReadDatasetFolder(const std::string& dir) {
  if (ListPhotos(dir, "dir").ok()) return std::nullopt;
  LITAGS_ASSIGN_OR_RETURN(std::vector<DatasetFile> files, FilesIn(dir));
  const DatasetLayout layout(std::move(files));
  if (layout.photos().empty() || fs::path(layout.photos()).has_parent_path()) return std::nullopt;
  DatasetFolder found;
  found.photos = fs::path(dir) / layout.photos();
  if (layout.cameras()) found.cameras = fs::path(dir) / *layout.cameras();
  found.cameras_are_ambiguous = layout.cameras_are_ambiguous();
  found.masks = FolderIn(dir, {"masks", "mask"});
  found.depth = FolderIn(dir, {"depths", "depth"});
  found.notes = layout.Notes();
  if (!found.depth.empty() && !HoldsDepthMaps(found.depth)) {
    found.notes.push_back(found.depth + " (it holds no depth maps: .png .pfm .npy)");
    found.depth.clear();
  }
  return found;
}

}  // namespace

absl::Status UseDatasetFolder(bool with_cameras, std::string* photos, std::string* cameras,
                              std::string* masks, std::string* depth) {
  LITAGS_ASSIGN_OR_RETURN(const std::optional<DatasetFolder> dataset, ReadDatasetFolder(*photos));
  if (!dataset) return absl::OkStatus();
  const auto use = [](const char* what, const std::string& path, std::string* out) {
    if (path.empty() || !out->empty()) return;
    *out = path;
    std::fprintf(stderr, "%s: those in %s\n", what, WithoutControls(path).c_str());
  };
  if (with_cameras && cameras->empty() && dataset->cameras_are_ambiguous) {
    return InvalidInput("CAMERAS_TWICE", "--cameras",
                        absl::StrCat(*photos,
                                     " has several files of cameras; name one with "
                                     "--cameras"));
  }
  photos->clear();
  use("photos", dataset->photos, photos);
  if (with_cameras) use("cameras", dataset->cameras, cameras);
  use("masks", dataset->masks, masks);
  use("depth maps", dataset->depth, depth);
  for (const std::string& note : dataset->notes) {
    std::fprintf(stderr, "note: not used: %s\n", WithoutControls(note).c_str());
  }
  return absl::OkStatus();
}

void UseMasksBeside(const std::string& photos, std::string* masks) {
  const fs::path beside = fs::path(photos) / "masks";
  std::error_code ignored;
  if (!masks->empty() || !fs::is_directory(beside, ignored)) return;
  *masks = beside;
  std::fprintf(stderr, "masks: those in %s\n", WithoutControls(*masks).c_str());
}

}  // namespace litags
