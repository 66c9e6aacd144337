#include "client/cameras_source.h"

#include <algorithm>
#include <cstdint>
#include <fstream>
#include <iterator>
#include <map>
#include <set>
#include <system_error>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "client/folder.h"
#include "client/status.h"

namespace litags::client {
namespace {

namespace fs = std::filesystem;

constexpr const char* kCamerasFiles[] = {"transforms.json", "sfm_data.json", "cameras.sfm",
                                         "cameras.xml", "bundle.out"};

// How many images a COLMAP model says that it has: the number that images.bin begins with, else the
// lines of images.txt that end in a name. engine/io/cameras_io.cc has the same rule.
uint64_t ImagesOf(const fs::path& dir) {
  uint64_t count = 0;
  std::ifstream binary(dir / "images.bin", std::ios::binary);
  if (binary.read(reinterpret_cast<char*>(&count), sizeof(count))) return count;
  std::ifstream text(dir / "images.txt");
  count = 0;
  for (std::string line; std::getline(text, line);) {
    const absl::string_view words = absl::StripAsciiWhitespace(line);
    double number = 0;
    count += !words.empty() && words[0] != '#' &&
             !absl::SimpleAtod(words.substr(words.find_last_of(" \t") + 1), &number);
  }
  return count;
}

// The folder itself or one in it: the COLMAP model with most images; empty: there is none.
fs::path LargestModel(const fs::path& dir) {
  std::vector<fs::path> models = {dir};
  std::error_code ignored;
  for (const fs::directory_entry& entry : EntriesOf(dir, &ignored)) models.push_back(entry.path());
  std::erase_if(models, [](const fs::path& folder) { return !IsColmapModel(folder); });
  std::sort(models.begin(), models.end());
  const auto largest = std::max_element(
      models.begin(), models.end(),
      [](const fs::path& a, const fs::path& b) { return ImagesOf(a) < ImagesOf(b); });
  return largest == models.end() ? fs::path() : *largest;
}

// A file of cameras, or the folder of a COLMAP model, seen from the dataset's folder.
struct Source {
  fs::path path;
  bool is_model = false;
  uintmax_t bytes = 0;  // of a model's list of images
};

// Other copies of the photos, and what programs worked with.
bool IsLeftOut(const std::string& folder, const std::string& photos) {
  const std::string name = absl::AsciiStrToLower(folder);
  return folder != photos && (name == "images" || name.starts_with("images_") || name == "input" ||
                              name == "distorted" || name == "stereo" || name == "dense");
}

uintmax_t ListBytes(const fs::path& model) {
  uintmax_t most = 0;
  for (const char* name : {"images.bin", "images.txt"}) {
    std::error_code error;
    const uintmax_t bytes = fs::file_size(model / name, error);
    if (!error) most = std::max(most, bytes);
  }
  return most;
}

// Names of the folders in `dir`, first those whose names say what is in them, then links, whose
// names somebody chose.
std::vector<std::string> FolderNamesIn(const fs::path& dir) {
  std::set<std::pair<int, std::string>> folders;
  std::error_code ignored;
  for (const fs::directory_entry& entry : EntriesOf(dir, &ignored)) {
    const std::string name = entry.path().filename().string();
    if (name.starts_with('.') || !entry.is_directory(ignored)) continue;
    const bool known = name == "sparse" || name == "colmap" || name.starts_with("images");
    folders.emplace(known ? 0 : entry.is_symlink(ignored) ? 1 : 2, name);
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

// The dataset's folders that may hold cameras, seen from `dir`, the outer ones first. A linked one
// is as one that is there; each is listed once, so that links in a circle end.
// engine/tools/inspect/dataset_folder.cc has the same rule.
std::vector<fs::path> FoldersIn(const fs::path& dir, const std::string& photos) {
  constexpr int kMostFolders = 3;  // "colmap/sparse/0/cameras.bin" is the deepest that is meant
  std::error_code ignored;
  const fs::path dataset = fs::canonical(dir, ignored);
  std::set<fs::path> seen;
  std::vector<fs::path> folders = {""};
  for (size_t i = 0; i < folders.size(); ++i) {
    const fs::path folder = folders[i];
    if (std::distance(folder.begin(), folder.end()) == kMostFolders) continue;
    for (const std::string& name : FolderNamesIn(dir / folder)) {
      if (folder.empty() && IsLeftOut(name, photos)) continue;
      const fs::path real = fs::canonical(dir / folder / name, ignored);
      if (!LeadsUp(real, dataset) && seen.insert(real).second) folders.push_back(folder / name);
    }
  }
  return folders;
}

// By path, whatever the disk's order is.
std::map<fs::path, Source> SourcesIn(const fs::path& dir, const std::string& photos) {
  std::map<fs::path, Source> sources;
  std::error_code ignored;
  for (const fs::path& folder : FoldersIn(dir, photos)) {
    // Text of this name may be anything, save where COLMAP's is.
    const bool colmap = absl::StrContains(folder.string(), "sparse") ||
                        absl::StrContains(folder.string(), "colmap");
    for (const fs::directory_entry& entry : EntriesOf(dir / folder, &ignored)) {
      const std::string name = entry.path().filename().string();
      if (!entry.is_regular_file(ignored)) continue;
      if (name == "cameras.bin" || (name == "cameras.txt" && colmap)) {
        sources[folder] = {folder, /*is_model=*/true, ListBytes(dir / folder)};
      } else if (std::find(std::begin(kCamerasFiles), std::end(kCamerasFiles), name) !=
                 std::end(kCamerasFiles)) {
        sources[folder / name] = {folder / name};
      }
    }
  }
  return sources;
}

// The place in the list of docs/datasets.md, as engine/io/dataset_layout.cc has it. 0: another.
int RankIn(const Source& source, const fs::path& root) {
  if (!source.is_model) {
    if (source.path.parent_path() != root) return 0;
    return source.path.filename() == "transforms.json" ? 2 : 3;
  }
  const auto is_below = [&](const fs::path& folder) {
    return source.path == folder || source.path.parent_path() == folder;
  };
  if (source.path == root || is_below(root / "sparse")) return 1;
  return source.path == root / "colmap" || is_below(root / "colmap" / "sparse") ? 4 : 0;
}

}  // namespace

std::string CamerasFileNames() { return absl::StrJoin(kCamerasFiles, ", "); }

bool IsColmapModel(const fs::path& dir) {
  std::error_code ignored;
  return fs::exists(dir / "cameras.bin", ignored) || fs::exists(dir / "cameras.txt", ignored);
}

fs::path ResolveCameras(const fs::path& path) {
  std::error_code ignored;
  if (!fs::is_directory(path, ignored) || IsColmapModel(path)) return path;
  if (fs::path model = LargestModel(path / "sparse"); !model.empty()) return model;
  for (const char* name : kCamerasFiles) {
    if (fs::is_regular_file(path / name, ignored)) return path / name;
  }
  for (const fs::path& parent : {path, path / "colmap/sparse", path / "colmap"}) {
    if (fs::path model = LargestModel(parent); !model.empty()) return model;
  }
  return path;
}

absl::StatusOr<DatasetCameras> CamerasOfDataset(const fs::path& dir, const std::string& photos) {
  const std::map<fs::path, Source> sources = SourcesIn(dir, photos);
  std::map<int, std::vector<Source>> by_rank;
  for (const auto& [path, source] : sources) {
    int rank = RankIn(source, "");
    if (rank == 0) rank = RankIn(source, photos);
    // The only one there is may lie anywhere.
    if (rank > 0 || sources.size() == 1) by_rank[rank].push_back(source);
  }
  DatasetCameras cameras;
  if (sources.empty()) return cameras;
  const auto name_of = [](const fs::path& path) { return path.empty() ? "." : path.string(); };
  if (by_rank.empty() ||
      (by_rank.begin()->second.size() > 1 && !by_rank.begin()->second[0].is_model)) {
    const auto append = [&](std::string* out, const auto& source) {
      absl::StrAppend(out, name_of(source.first));
    };
    return BadInput(
        "CAMERAS_TWICE", "--cameras",
        absl::StrCat(dir.string(), " has several files of cameras (",
                     absl::StrJoin(sources, ", ", append), "); name one with --cameras"));
  }
  const std::vector<Source>& best = by_rank.begin()->second;
  const fs::path used =
      std::max_element(best.begin(), best.end(), [](const Source& a, const Source& b) {
        return a.bytes < b.bytes;
      })->path;
  cameras.used = used.empty() ? dir : dir / used;
  for (const auto& [path, source] : sources) {
    if (path != used) cameras.others.push_back(name_of(path));
  }
  return cameras;
}

}  // namespace litags::client
