#include "engine/io/dataset_layout.h"

#include <algorithm>
#include <optional>
#include <set>
#include <string_view>

#include "absl/strings/ascii.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/strings/string_view.h"
#include "engine/io/file_util.h"

namespace litags {
namespace {

using Kind = DatasetFile::Kind;

std::string ParentOf(const std::string& path) {
  const size_t slash = path.rfind('/');
  return slash == std::string::npos ? "" : path.substr(0, slash);
}

std::string LastOf(const std::string& path) {
  const size_t slash = path.rfind('/');
  return absl::AsciiStrToLower(slash == std::string::npos ? path : path.substr(slash + 1));
}

std::string In(const std::string& folder, std::string_view name) {
  std::string path = folder.empty() ? "" : folder + "/";
  path.append(name);
  return path;
}

// Whether `path` is `folder` or lies in it.
bool IsIn(const std::string& path, const std::string& folder) {
  return folder.empty() || path == folder || path.starts_with(folder + "/");
}

// By how much "images_4" is smaller than "images"; 1 for "images" itself, nullopt for other names.
std::optional<int> ShrinkOf(const std::string& folder, std::string_view whole) {
  const std::string name = LastOf(folder);
  if (name == whole) return 1;
  if (!name.starts_with(std::string(whole) + "_")) return std::nullopt;
  int shrink = 0;
  if (!absl::SimpleAtoi(absl::string_view(name).substr(whole.size() + 1), &shrink) || shrink < 2) {
    return std::nullopt;
  }
  return shrink;
}

// The folders of `files` and those that these lie in.
std::set<std::string> FoldersOf(const std::vector<DatasetFile>& files) {
  std::set<std::string> folders;
  for (const DatasetFile& file : files) {
    for (std::string f = file.folder; folders.insert(f).second && !f.empty();) f = ParentOf(f);
  }
  return folders;
}

// Photos before 3DGS' convert.py undistorted them, and what it and COLMAP worked with.
bool IsWorkFolder(const std::string& folder) {
  const std::string name = LastOf(folder);
  return name == "input" || name == "distorted" || name == "stereo" || name == "dense";
}

// Whether the folder says what kind of files are in it.
bool IsPart(const std::string& folder, const std::string& photos) {
  const std::string name = LastOf(folder);
  return name == LastOf(photos) || name == "mask" || name == "masks" || name == "depth" ||
         name == "depths";
}

// A file of cameras, or the folder of a COLMAP model.
struct Source {
  std::string path;
  bool is_model = false;
  int64_t bytes = 0;  // of a model's images
};

std::string SourceOf(const DatasetFile& file) {
  return file.kind == Kind::kModel ? file.folder : file.Path();
}

// Sources of the least rank are used, of several models of one rank the largest. -1: another place.
int RankIn(const Source& source, const std::string& root) {
  constexpr int kSparse = 0, kTransforms = 1, kOtherPrograms = 2, kColmap = 3;
  if (!source.is_model) {
    if (ParentOf(source.path) != root) return -1;
    return LastOf(source.path) == "transforms.json" ? kTransforms : kOtherPrograms;
  }
  const auto is_below = [&](const std::string& folder) {
    return source.path == folder || (source.path != "" && ParentOf(source.path) == folder);
  };
  if (source.path == root || is_below(In(root, "sparse"))) return kSparse;
  return source.path == In(root, "colmap") || is_below(In(root, "colmap/sparse")) ? kColmap : -1;
}

}  // namespace

DatasetLayout::DatasetLayout(const std::vector<DatasetFile>& files) {
  ChoosePhotos(files);
  LookForRig(files);
  ChooseCameras(files);
}

void DatasetLayout::ChoosePhotos(const std::vector<DatasetFile>& files) {
  std::map<std::string, std::pair<int, std::string>> largest;  // by the folder around them
  for (const DatasetFile& file : files) {
    if (file.kind != Kind::kPhoto) continue;
    std::string folder = file.folder;
    while (!folder.empty() && !ShrinkOf(folder, "images")) folder = ParentOf(folder);
    if (folder.empty()) continue;
    const std::pair found(*ShrinkOf(folder, "images"), folder);
    const auto [first, added] = largest.emplace(ParentOf(folder), found);
    if (!added) first->second = std::min(first->second, found);
  }
  // Several captures side by side are none.
  if (largest.empty()) return;
  const std::string root = largest.begin()->first;
  for (const auto& [other, unused] : largest) {
    if (!IsIn(other, root)) return;
  }
  photos_ = largest.begin()->second.second;
  const std::set<std::string> folders = FoldersOf(files);
  for (const std::string& folder : folders) {
    if (folder.empty() || folder == photos_ || ParentOf(folder) != root) continue;
    bool is_copy = ShrinkOf(folder, "images").has_value();
    for (const char* whole : {"mask", "masks", "depth", "depths"}) {
      is_copy |= ShrinkOf(folder, whole).value_or(1) > 1 && folders.contains(In(root, whole));
    }
    if (!is_copy && !IsWorkFolder(folder)) continue;
    folders_[folder] = absl::StrCat("the photos are those in ", photos_, "/");
  }
}

void DatasetLayout::LookForRig(const std::vector<DatasetFile>& files) {
  std::set<std::string> names;
  for (const DatasetFile& file : files) {
    if (photos_.empty() || file.kind != Kind::kPhoto) continue;
    // Beside photos themselves, folders hold other things, as thumbnails.
    if (!IsIn(file.folder, photos_) || file.folder == photos_) continue;
    is_rig_ |= !names.insert(file.name).second;
  }
}

std::string DatasetLayout::NameOf(const DatasetFile& file) const {
  const bool is_photo = file.kind == Kind::kPhoto;
  if (!is_photo && file.kind != Kind::kMask && file.kind != Kind::kDepth) return file.name;
  const std::string root = is_photo ? photos_ : ParentOf(photos_);
  if (!is_rig_ || !IsIn(file.folder, root)) return file.name;
  std::string path;
  for (const absl::string_view folder :
       absl::StrSplit(absl::string_view(file.folder).substr(root.size()), '/', absl::SkipEmpty())) {
    if (!IsPart(std::string(folder), photos_)) absl::StrAppend(&path, folder, "/");
  }
  return NamesInOneFolder(path + file.name).front();
}

void DatasetLayout::ChooseCameras(const std::vector<DatasetFile>& files) {
  std::map<std::string, Source> sources;
  std::set<std::string> photo_folders;
  for (const DatasetFile& file : files) {
    if (IsInLeftOutFolder(file.folder)) continue;
    if (file.kind == Kind::kPhoto) photo_folders.insert(file.folder);
    if (file.kind != Kind::kCameras && file.kind != Kind::kModel) continue;
    Source& source = sources[SourceOf(file)];
    source.path = SourceOf(file);
    source.is_model = file.kind == Kind::kModel;
    if (file.name.starts_with("images.")) source.bytes = std::max(source.bytes, file.bytes);
  }
  sources_ = sources.size();
  if (sources.size() == 1) cameras_ = sources.begin()->first;
  std::vector<std::string> places;
  if (!photos_.empty()) places = {ParentOf(photos_), photos_};
  if (photo_folders.size() == 1) {
    places.push_back(ParentOf(*photo_folders.begin()));
    places.push_back(*photo_folders.begin());
  }
  if (sources.size() < 2) return;
  std::map<int, std::vector<Source>> by_rank;
  for (const auto& [path, source] : sources) {
    int rank = -1;
    for (size_t i = 0; i < places.size() && rank < 0; ++i) rank = RankIn(source, places[i]);
    if (rank >= 0) by_rank[rank].push_back(source);
  }
  if (by_rank.empty()) return;
  const std::vector<Source>& best = by_rank.begin()->second;
  if (best.size() > 1 && !best[0].is_model) return;
  cameras_ = std::max_element(best.begin(), best.end(), [](const Source& a, const Source& b) {
               return a.bytes < b.bytes;
             })->path;
  for (const auto& [path, source] : sources) {
    if (path == cameras_) continue;
    no_cameras_[path] = absl::StrCat("the cameras are those in ", *cameras_);
  }
}

bool DatasetLayout::IsInLeftOutFolder(const std::string& folder) const {
  return std::any_of(folders_.begin(), folders_.end(),
                     [&](const auto& left_out) { return IsIn(folder, left_out.first); });
}

bool DatasetLayout::Uses(const DatasetFile& file) const {
  if (IsInLeftOutFolder(file.folder)) return false;
  return (file.kind != Kind::kCameras && file.kind != Kind::kModel) ||
         !no_cameras_.contains(SourceOf(file));
}

std::vector<std::string> DatasetLayout::Notes() const {
  std::vector<std::string> notes;
  for (const auto& [folder, why] : folders_) notes.push_back(absl::StrCat(folder, "/ (", why, ")"));
  for (const auto& [path, why] : no_cameras_) {
    notes.push_back(
        absl::StrCat(path.empty() ? "COLMAP's files at the top" : path, " (", why, ")"));
  }
  return notes;
}

}  // namespace litags
