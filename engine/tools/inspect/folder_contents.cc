#include "engine/tools/inspect/folder_contents.h"

#include <filesystem>
#include <set>
#include <system_error>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "engine/core/error.h"
#include "engine/io/file_util.h"
#include "engine/io/image_io.h"
#include "engine/video/video_file.h"

namespace litags {
namespace {

namespace fs = std::filesystem;

constexpr size_t kMostNames = 5;  // of a list; others are counted

// "a, b, c and 4 others".
std::string Listed(std::vector<std::string> names) {
  const size_t others = names.size() > kMostNames ? names.size() - kMostNames : 0;
  names.resize(names.size() - others);
  const std::string list = absl::StrJoin(names, ", ");
  if (others == 0) return list;
  return absl::StrCat(list, " and ", others, others == 1 ? " other" : " others");
}

// What is not hidden, sorted: folders, or all else.
std::vector<std::string> NamesIn(const std::string& dir, bool folders) {
  const auto names = ListNames(dir, "dir", [&](const fs::directory_entry& entry) {
    std::error_code ignored;
    return !entry.path().filename().string().starts_with('.') &&
           entry.is_directory(ignored) == folders;
  });
  return names.ok() ? *names : std::vector<std::string>();
}

// What `litags submit` takes as an archive of photos.
bool IsArchiveName(const std::string& name) {
  const std::string lower = absl::AsciiStrToLower(name);
  return lower.ends_with(".zip") || lower.ends_with(".tar") || lower.ends_with(".tar.gz") ||
         lower.ends_with(".tgz");
}

// In place of a file.
std::string WhatToGiveFor(const std::string& name) {
  if (IsArchiveName(name)) return "unpack it and give the folder, or give it to litags submit";
  if (IsPhotoName(name)) return "give the folder that holds it";
  return absl::StrCat("give the folder that holds the photos, or rename a video to end in one of ",
                      VideoEndings());
}

size_t PhotosIn(const std::string& dir) {
  const auto photos = ListPhotos(dir, "dir");
  return photos.ok() ? photos->size() : 0;
}

// What a photo may be called in one folder whose name one of another of these folders has, too:
// "cam1_0004.jpg". Empty: no two have one name.
std::string NameOfTwo(const std::string& dir, const std::vector<std::string>& folders) {
  std::set<std::string> names;
  for (const std::string& folder : folders) {
    const auto photos = ListPhotos(absl::StrCat(dir, "/", folder), "dir");
    if (!photos.ok()) continue;
    for (const std::string& name : *photos) {
      if (!names.insert(name).second) return absl::StrCat(folder, "_", name);
    }
  }
  return "";
}

// Whether the run reads this file or folder by an option of its own.
bool IsOtherInput(const ReconstructInput& input, const std::string& name) {
  std::error_code ignored;
  const fs::path path = fs::path(input.images_dir) / name;
  for (const std::string& used : {input.cameras_path, input.masks_dir, input.depth_dir}) {
    if (!used.empty() && fs::equivalent(path, used, ignored)) return true;
  }
  return !input.cameras_path.empty() && IsModelFile(name) &&
         fs::equivalent(input.images_dir, input.cameras_path, ignored);
}

}  // namespace

bool IsModelFile(const std::string& name) {
  const std::string stem = fs::path(name).stem();
  return stem == "cameras" || stem == "images" || stem == "points3D";
}

std::vector<std::string> FoldersOfPhotos(const std::string& dir) {
  std::vector<std::string> folders = NamesIn(dir, /*folders=*/true);
  std::erase_if(folders, [&](const std::string& name) {
    return name == "masks" || PhotosIn(absl::StrCat(dir, "/", name)) == 0;
  });
  return folders;
}

absl::Status CheckHoldsPhotos(const std::string& dir) {
  if (std::error_code ignored; fs::is_regular_file(dir, ignored)) {
    return InvalidInput("NO_SUCH_FOLDER", "DIR",
                        absl::StrCat(dir, " is a file; ", WhatToGiveFor(dir)));
  }
  const absl::Status photos = ListPhotos(dir, "DIR").status();
  if (photos.ok()) return photos;
  std::vector<std::string> folders = FoldersOfPhotos(dir);
  if (folders.empty()) return photos;
  const std::string twice = NameOfTwo(dir, folders);
  const std::string of_rig = twice.empty()
                                 ? ""
                                 : absl::StrCat(" Photos of a rig: copy them to one folder as ",
                                                twice, "; their cameras are still found");
  for (std::string& folder : folders) folder = fs::path(dir) / folder;
  return InvalidInput("NO_PHOTOS", "DIR",
                      absl::StrCat(dir, " holds no photos itself: did you mean ",
                                   Listed(std::move(folders)), "?", of_rig));
}

std::vector<std::string> DescribeUnused(const ReconstructInput& input) {
  std::vector<std::string> notes, not_read;
  for (const std::string& name : NamesIn(input.images_dir, /*folders=*/false)) {
    if (IsPhotoName(name) || IsOtherInput(input, name)) continue;
    not_read.push_back(IsVideoName(name) ? name + " (a video: give it alone)" : name);
  }
  if (!not_read.empty()) notes.push_back("not read: " + Listed(std::move(not_read)));
  for (const std::string& name : FoldersOfPhotos(input.images_dir)) {
    if (IsOtherInput(input, name)) continue;
    const size_t photos = PhotosIn(absl::StrCat(input.images_dir, "/", name));
    notes.push_back(absl::StrCat(photos, photos == 1 ? " photo in " : " photos in ", name,
                                 photos == 1 ? "/ is not used" : "/ are not used"));
  }
  return notes;
}

}  // namespace litags
