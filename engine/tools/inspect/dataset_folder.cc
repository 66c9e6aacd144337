#include "engine/tools/inspect/dataset_folder.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <initializer_list>
#include <iterator>
#include <optional>
#include <set>
#include <system_error>
#include <utility>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/core/photo_names.h"
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

// Adds the files of one folder of the dataset; returns the folders in it, first those whose names
// say what is in them, then links, whose names somebody chose. None if it may not be read.
absl::StatusOr<std::vector<std::string>> ReadFolder(const fs::path& dir, const std::string& folder,
                                                    std::vector<DatasetFile>* files) {
  std::set<std::pair<int, std::string>> folders;
  std::error_code error, ignored;
  fs::directory_iterator it(dir / folder, fs::directory_options::skip_permission_denied, error);
  for (const fs::directory_iterator end; !error && it != end; it.increment(error)) {
    const std::string name = it->path().filename();
    if (name.starts_with('.')) continue;
    if (it->is_directory(ignored)) {
      const bool known = name == "sparse" || name == "colmap" || name.starts_with("images");
      folders.emplace(known ? 0 : it->is_symlink(ignored) ? 1 : 2, name);
    }
    if (!it->is_regular_file(ignored)) continue;
    DatasetFile file{folder, name, KindOf(folder, name)};
    if (file.kind == Kind::kModel) file.bytes = static_cast<int64_t>(it->file_size(ignored));
    files->push_back(std::move(file));
  }
  if (error) {
    return MakeError(
        absl::StatusCode::kInternal, "IO_ERROR", "dir",
        absl::StrCat("cannot list the folder '", dir.string(), "': ", error.message()));
  }
  std::vector<std::string> names;
  for (const auto& [turn, name] : folders) names.push_back(name);
  return names;
}

// Of real paths: whether the dataset lies in `folder`, where others may lie, too.
bool LeadsUp(const fs::path& folder, const fs::path& dataset) {
  return std::mismatch(folder.begin(), folder.end(), dataset.begin(), dataset.end()).first ==
         folder.end();
}

// None if `dir` is no folder. A linked folder is as one that is there; each is read once, so that
// links in a circle end. client/cameras_source.cc has the same rule.
absl::StatusOr<std::vector<DatasetFile>> FilesIn(const fs::path& dir) {
  std::vector<DatasetFile> files;
  std::error_code ignored;
  if (!fs::is_directory(dir, ignored)) return files;
  const fs::path dataset = fs::canonical(dir, ignored);
  std::set<fs::path> seen;
  std::vector<fs::path> folders = {""};  // the outer ones first
  for (size_t i = 0; i < folders.size(); ++i) {
    const fs::path folder = folders[i];
    LITAGS_ASSIGN_OR_RETURN(const std::vector<std::string> inner, ReadFolder(dir, folder, &files));
    if (std::distance(folder.begin(), folder.end()) == kMostFolders) continue;
    for (const std::string& name : inner) {
      const fs::path real = fs::canonical(dir / folder / name, ignored);
      if (!LeadsUp(real, dataset) && seen.insert(real).second) folders.push_back(folder / name);
    }
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
    const std::vector<std::string> names = DepthMapNames(WithoutEnding(name));
    return !name.starts_with('.') && std::find(names.begin(), names.end(), name) != names.end();
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
