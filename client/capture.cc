#include "client/capture.h"

#include <openssl/evp.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <initializer_list>
#include <iterator>
#include <memory>
#include <set>
#include <string_view>
#include <system_error>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/strip.h"
#include "absl/types/span.h"
#include "client/cameras_source.h"
#include "client/folder.h"
#include "client/report/text.h"
#include "client/status.h"
#include "proto/litags/v1/limits.h"

namespace litags::client {
namespace {

namespace fs = std::filesystem;

constexpr size_t kReadBytes = 256 << 10;

using Endings = absl::Span<const std::string_view>;

bool HasEnding(const fs::path& path, Endings endings) {
  const std::string name = absl::AsciiStrToLower(path.filename().string());
  return std::any_of(endings.begin(), endings.end(), [&](std::string_view ending) {
    return name.size() > ending.size() && std::string_view(name).ends_with(ending);
  });
}

absl::Status Unreadable(const std::string& path, const std::string& why) {
  const std::string shown = report::PrintableLine(path);
  return BadInput("FILE_UNREADABLE", shown,
                  absl::StrCat(shown, ": cannot be read (", why,
                               "); check that it exists and may "
                               "be read"));
}

// OK, or why a file of this path cannot be sent.
absl::Status FindTrouble(const fs::path& path) {
  if (!report::IsUtf8(path.filename().string())) {
    const std::string shown = report::PrintableLine(path.string());
    return BadInput("BAD_FILE_NAME", shown,
                    absl::StrCat(shown,
                                 ": the file's name is not UTF-8; rename it, for instance with "
                                 "convmv or mv"));
  }
  std::error_code error;
  if (fs::is_regular_file(path, error)) return absl::OkStatus();
  // A link to what is gone, for one.
  return Unreadable(path.string(), error ? error.message() : "not a file");
}

LocalFile MakeLocalFile(const fs::path& path, v1::FileRole role) {
  LocalFile file;
  file.path = path.string();
  file.name = path.filename().string();
  file.role = role;
  file.trouble = FindTrouble(path);
  if (!file.trouble.ok()) return file;
  std::error_code error;
  file.size_bytes = static_cast<int64_t>(fs::file_size(path, error));
  if (error) file.trouble = Unreadable(file.path, error.message());
  return file;
}

void Add(LocalFile file, Capture* capture) {
  if (file.trouble.ok()) capture->bytes += file.size_bytes;
  capture->files.push_back(std::move(file));
}

// Of a file without which there is no job.
absl::Status AddNeeded(LocalFile file, Capture* capture) {
  if (!file.trouble.ok()) return file.trouble;
  Add(std::move(file), capture);
  return absl::OkStatus();
}

std::string Joined(Endings endings) {
  return absl::StrJoin(endings, " ",
                       [](std::string* out, std::string_view ending) { out->append(ending); });
}

struct PhotoFolder {
  fs::path path;
  std::vector<std::string> photos;  // their names
};

// The subfolders with photos in them, sorted; "masks" holds none. litags inspect has the same rule
// (engine/tools/inspect/folder_contents.cc).
std::vector<PhotoFolder> FoldersWithPhotos(const fs::path& dir) {
  std::vector<PhotoFolder> folders;
  std::error_code ignored;
  for (const fs::directory_entry& entry : EntriesOf(dir, &ignored)) {
    const std::string name = entry.path().filename().string();
    if (name.starts_with(".") || name == "masks" || !entry.is_directory(ignored)) continue;
    PhotoFolder folder{entry.path(), {}};
    for (const fs::directory_entry& inner : EntriesOf(entry.path(), &ignored)) {
      const bool hidden = inner.path().filename().string().starts_with(".");
      if (hidden || !HasEnding(inner.path(), v1::kPhotoEndings)) continue;
      folder.photos.push_back(inner.path().filename().string());
    }
    std::sort(folder.photos.begin(), folder.photos.end());
    if (!folder.photos.empty()) folders.push_back(std::move(folder));
  }
  std::sort(folders.begin(), folders.end(),
            [](const PhotoFolder& a, const PhotoFolder& b) { return a.path < b.path; });
  return folders;
}

// What to do if folders whose photos share names are a rig's; else "".
std::string RigAdvice(const std::vector<PhotoFolder>& folders) {
  std::set<std::string> names;
  for (const PhotoFolder& folder : folders) {
    for (const std::string& name : folder.photos) {
      if (names.insert(name).second) continue;
      const std::string camera = folder.path.filename().string();
      return absl::StrCat(" Photos of a rig: pack them and their cameras in a ZIP file, as images/",
                          camera, "/", name, ", or copy them to one folder as ", camera, "_", name);
    }
  }
  return "";
}

// "did you mean room/day, room/night?", or "" where no subfolder holds photos.
std::string SuggestFolders(const std::vector<PhotoFolder>& folders) {
  constexpr size_t kMost = 5;
  if (folders.empty()) return "";
  std::string text = "did you mean ";
  for (size_t i = 0; i < std::min(kMost, folders.size()); ++i) {
    absl::StrAppend(&text, i == 0 ? "" : ", ", folders[i].path.string());
  }
  const size_t more = folders.size() - std::min(kMost, folders.size());
  return absl::StrCat(
      text,
      more > 0
          ? absl::StrCat(" or ", more == 1 ? "one other" : absl::StrCat("one of ", more, " others"))
          : "",
      "?", RigAdvice(folders));
}

// Where the parts of a capture are; empty: they are none.
struct Places {
  std::string photos, cameras, depth, masks;
};

// What is used by an option of its own, as --depth photos/depth, needs no note.
void NoteUnusedFolders(const std::string& dir, const Places& used, Capture* capture) {
  std::error_code ignored;
  for (const PhotoFolder& folder : FoldersWithPhotos(dir)) {
    const auto is_it = [&](const std::string& place) {
      return fs::equivalent(folder.path, place, ignored);
    };
    if (is_it(used.photos) || is_it(used.cameras) || is_it(used.depth) || is_it(used.masks)) {
      continue;
    }
    const bool one = folder.photos.size() == 1;
    capture->notes.push_back(absl::StrCat(folder.photos.size(), one ? " photo in " : " photos in ",
                                          folder.path.filename().string(),
                                          one ? "/ is not used" : "/ are not used"));
  }
}

// COLMAP's recipe for known poses makes it with nothing in it.
bool IsEmptyPoints(const fs::path& path) {
  std::error_code ignored;
  return path.filename() == "points3D.txt" && fs::is_empty(path, ignored);
}

// The files of a COLMAP model, in text form if there is no binary one; it may have no points.
absl::Status AddColmapModel(const std::string& dir, Capture* capture) {
  std::error_code ignored;  // MakeLocalFile says what is wrong
  if (!IsColmapModel(dir)) {
    return BadInput(
        "NO_CAMERAS_IN_FOLDER", "--cameras",
        absl::StrCat(dir,
                     ": has neither a COLMAP model (cameras.bin, images.bin; in it, in "
                     "sparse or in a folder of these) nor ",
                     CamerasFileNames(), "; give the file or the folder of the cameras"));
  }
  const bool text = !fs::exists(fs::path(dir) / "cameras.bin", ignored) &&
                    fs::exists(fs::path(dir) / "cameras.txt", ignored);
  for (const char* stem : {"cameras", "images", "points3D"}) {
    const fs::path path = fs::path(dir) / absl::StrCat(stem, text ? ".txt" : ".bin");
    if (std::string_view(stem) == "points3D" && !fs::exists(path, ignored)) continue;
    if (IsEmptyPoints(path)) continue;
    const absl::Status added = AddNeeded(MakeLocalFile(path, v1::FILE_ROLE_COLMAP), capture);
    if (!added.ok()) return added;
  }
  return absl::OkStatus();
}

// Bundler keeps the photos' names in a file of its own, beside bundle.out: NAME.list.txt of
// NAME.bundle.out, as COLMAP writes it, list.txt, or the only *.lst (RealityScan). The service
// takes both as one.
void AppendBundlerList(LocalFile* cameras) {
  std::ifstream file(cameras->path);
  std::string line;
  if (!std::getline(file, line) || !absl::StrContains(line, "# Bundle file")) return;
  absl::string_view stem = cameras->path;
  if (!absl::ConsumeSuffix(&stem, ".bundle.out")) absl::ConsumeSuffix(&stem, ".out");
  std::error_code ignored;
  const fs::path folder = fs::absolute(cameras->path, ignored).parent_path();
  std::vector<fs::path> paths = {fs::path(absl::StrCat(stem, ".list.txt")), folder / "list.txt"};
  std::vector<fs::path> others;
  for (const fs::directory_entry& entry : EntriesOf(folder, &ignored)) {
    if (entry.path().extension() == ".lst") others.push_back(entry.path());
  }
  if (others.size() == 1) paths.push_back(others[0]);
  for (const fs::path& path : paths) {
    std::ifstream list(path, std::ios::binary);
    if (!list) continue;
    cameras->tail = absl::StrCat(
        "\n", std::string(std::istreambuf_iterator<char>(list), std::istreambuf_iterator<char>()));
    cameras->size_bytes += static_cast<int64_t>(cameras->tail.size());
    return;
  }
}

// "17 pictures are of a kind that is not read, 0001.webp for one: convert them to JPEG or PNG".
std::string DescribeOtherPictures(const std::vector<std::string>& names) {
  constexpr std::string_view kOther[] = {".bmp", ".gif", ".exr", ".hdr", ".jp2", ".pgm",
                                         ".ppm", ".psd", ".tga", ".crw", ".3fr", ".x3f"};
  std::vector<std::string> others;
  for (const std::string& name : names) {
    if (HasEnding(name, v1::kVideoEndings)) return absl::StrCat("give the video itself: ", name);
    if (HasEnding(name, kOther)) others.push_back(name);
  }
  if (others.empty()) return "";
  std::sort(others.begin(), others.end());
  return absl::StrCat(others.size(), others.size() == 1 ? " file is" : " files are",
                      " of a kind that is not read, ", others[0],
                      others.size() == 1 ? "" : " for one", ": convert to JPEG or PNG");
}

// Adds the files of one folder; those with other endings go to capture->skipped.
absl::Status ScanFolder(const std::string& dir, std::string_view field, v1::FileRole role,
                        Endings endings, Capture* capture) {
  std::error_code error;
  const char* things = role == v1::FILE_ROLE_MASK    ? "masks"
                       : role == v1::FILE_ROLE_DEPTH ? "depth maps"
                                                     : "photos";
  if (!fs::is_directory(dir, error)) {
    return BadInput(
        "FOLDER_MISSING", field,
        absl::StrCat(dir,
                     fs::exists(dir, error) ? ": is not a folder" : ": there is no such folder",
                     "; give the folder that holds the ", things));
  }
  bool empty = true;
  for (const fs::directory_entry& entry : EntriesOf(dir, &error)) {
    if (entry.path().filename().string().starts_with(".")) continue;
    empty = false;
    std::error_code entry_error;
    if (entry.is_directory(entry_error)) continue;
    if (!HasEnding(entry.path(), endings)) {
      capture->skipped.push_back(entry.path().filename().string());
      continue;
    }
    Add(MakeLocalFile(entry.path(), role), capture);
  }
  if (error) return Unreadable(dir, error.message());
  if (empty) {
    return BadInput(
        "FOLDER_EMPTY", field,
        absl::StrCat(dir, ": the folder is empty; give the folder that holds the ", things));
  }
  return absl::OkStatus();
}

absl::Status AddMasks(Capture* capture) {
  const size_t others = capture->files.size();
  const absl::Status status =
      ScanFolder(capture->masks_dir, "--masks", v1::FILE_ROLE_MASK, v1::kMaskEndings, capture);
  if (!status.ok() || capture->files.size() > others) return status;
  return BadInput("NO_MASKS", "--masks",
                  absl::StrCat(capture->masks_dir,
                               ": holds no masks (.png); name them <photo's name>.png, or remove "
                               "the folder"));
}

absl::Status AddDepth(const std::string& dir, Capture* capture) {
  const size_t others = capture->files.size();
  const absl::Status status =
      ScanFolder(dir, "--depth", v1::FILE_ROLE_DEPTH, v1::kDepthEndings, capture);
  if (!status.ok() || capture->files.size() > others) return status;
  return BadInput("NO_DEPTH_MAPS", "--depth",
                  absl::StrCat(dir, ": holds no depth maps (", Joined(v1::kDepthEndings),
                               "); convert them, name them <photo's name>.npy, or leave --depth "
                               "out"));
}

bool HoldsAny(const fs::path& dir, Endings endings) {
  std::error_code ignored;
  for (const fs::directory_entry& entry : EntriesOf(dir, &ignored)) {
    const bool hidden = entry.path().filename().string().starts_with(".");
    if (!hidden && HasEnding(entry.path(), endings)) return true;
  }
  return false;
}

bool HoldsPhotos(const fs::path& dir) { return HoldsAny(dir, v1::kPhotoEndings); }

// A dataset's folder, as of nerfstudio, 3DGS or Mip-NeRF 360, holds no photos itself, but images/
// (or smaller copies, images_2/) beside their cameras: puts the folders within in place of what the
// user did not name, as engine/tools/inspect/dataset_folder.cc does.
absl::Status UseDatasetFolder(Places* places, std::vector<std::string>* notes) {
  const fs::path dir = places->photos;
  std::error_code ignored;
  if (!fs::is_directory(dir, ignored) || HoldsPhotos(dir)) return absl::OkStatus();
  // The first of these folders that there is goes to `place`.
  const auto use = [&](std::string* place, std::initializer_list<const char*> names) {
    for (const char* name : names) {
      if (place->empty() && fs::is_directory(dir / name, ignored)) *place = dir / name;
    }
  };
  for (const char* name : {"images", "images_2", "images_4", "images_8"}) {
    if (!HoldsPhotos(dir / name)) continue;
    places->photos = dir / name;
    notes->push_back(absl::StrCat("photos: ", places->photos));
    use(&places->masks, {"masks", "mask"});
    std::string depth = places->depth;
    use(&depth, {"depths", "depth"});
    if (places->depth.empty() && !depth.empty() && !HoldsAny(depth, v1::kDepthEndings)) {
      notes->push_back(absl::StrCat("not used: ", depth,
                                    " (it holds no depth maps: ", Joined(v1::kDepthEndings), ")"));
    } else {
      places->depth = depth;
    }
    if (!places->cameras.empty()) return absl::OkStatus();
    const auto cameras = CamerasOfDataset(dir, name);
    if (!cameras.ok()) return cameras.status();
    places->cameras = cameras->used.string();
    if (!places->cameras.empty()) notes->push_back(absl::StrCat("cameras: ", places->cameras));
    if (!cameras->others.empty()) {
      notes->push_back(
          absl::StrCat("cameras that are not used: ", absl::StrJoin(cameras->others, ", ")));
    }
    return absl::OkStatus();
  }
  return absl::OkStatus();
}

// The photos, or the one file that holds them.
absl::Status AddPhotos(const std::string& path, Capture* capture) {
  std::error_code error;
  const bool archive = HasEnding(path, v1::kArchiveEndings);
  const bool one_file = archive || HasEnding(path, v1::kVideoEndings);
  if (one_file && fs::is_regular_file(path, error)) {
    return AddNeeded(MakeLocalFile(path, archive ? v1::FILE_ROLE_ARCHIVE : v1::FILE_ROLE_VIDEO),
                     capture);
  }
  if (one_file && !fs::exists(path, error)) {
    return BadInput("FILE_UNREADABLE", "DIR",
                    absl::StrCat(path, ": there is no such file; give one that is there"));
  }
  if (fs::is_regular_file(path, error)) {
    return BadInput("FOLDER_MISSING", "DIR",
                    absl::StrCat(path,
                                 ": is a file; give the folder that holds the photos, or rename a "
                                 "video to end in one of ",
                                 Joined(v1::kVideoEndings), ", an archive in one of ",
                                 Joined(v1::kArchiveEndings)));
  }
  const absl::Status status =
      ScanFolder(path, "DIR", v1::FILE_ROLE_PHOTO, v1::kPhotoEndings, capture);
  if (!status.ok() || !capture->files.empty()) return status;
  std::vector<PhotoFolder> folders = FoldersWithPhotos(path);
  if (folders.empty()) folders = FoldersWithPhotos(fs::path(path) / "images");
  const std::string inside = SuggestFolders(folders);
  const std::string others = DescribeOtherPictures(capture->skipped);
  return BadInput("NO_PHOTOS", "DIR",
                  absl::StrCat(path, ": holds no photos (", Joined(v1::kPhotoEndings), "); ",
                               !others.empty()  ? others
                               : inside.empty() ? "give the folder that holds them"
                                                : inside));
}

absl::Status AddCameras(const std::string& given, Capture* capture) {
  const std::string path = ResolveCameras(given).string();
  if (path != given) capture->notes.push_back(absl::StrCat("cameras: ", path));
  std::error_code ignored;
  if (fs::is_directory(path, ignored)) return AddColmapModel(path, capture);
  LocalFile cameras = MakeLocalFile(path, v1::FILE_ROLE_CAMERAS);
  if (cameras.trouble.ok()) AppendBundlerList(&cameras);
  return AddNeeded(std::move(cameras), capture);
}

}  // namespace

absl::StatusOr<Capture> ScanCapture(const std::string& photos_dir, const std::string& cameras_path,
                                    const std::string& depth_dir, const std::string& masks_dir) {
  Capture capture;
  Places places{photos_dir, cameras_path, depth_dir, masks_dir};
  absl::Status status = UseDatasetFolder(&places, &capture.notes);
  if (status.ok()) status = AddPhotos(places.photos, &capture);
  if (status.ok() && !places.cameras.empty()) status = AddCameras(places.cameras, &capture);
  if (status.ok() && !places.depth.empty()) status = AddDepth(places.depth, &capture);
  if (!status.ok()) return status;
  const fs::path beside = fs::path(places.photos) / "masks";
  if (std::error_code ignored; places.masks.empty() && fs::is_directory(beside, ignored)) {
    places.masks = beside.string();
  }
  capture.masks_dir = places.masks;
  if (!capture.masks_dir.empty()) {
    status = AddMasks(&capture);
    if (!status.ok()) return status;
  }
  NoteUnusedFolders(photos_dir, places, &capture);
  std::sort(capture.files.begin(), capture.files.end(), [](const auto& a, const auto& b) {
    return std::pair(a.role, a.name) < std::pair(b.role, b.name);
  });
  std::sort(capture.skipped.begin(), capture.skipped.end());
  return capture;
}

std::string DefaultTitle(const std::string& photos_dir) {
  std::error_code ignored;
  fs::path path = fs::absolute(photos_dir, ignored).lexically_normal();
  if (!path.has_filename()) path = path.parent_path();  // "photos/"
  const std::string name = path.filename().string();
  return name.size() > v1::kMaxDisplayNameBytes || report::Printable(name) != name ||
                 name.find('\n') != std::string::npos
             ? ""
             : name;
}

absl::StatusOr<std::string> FileSha256(const std::string& path, const Interrupt& interrupt,
                                       absl::string_view tail) {
  std::ifstream in(path, std::ios::binary);
  if (!in) return Unreadable(path, std::generic_category().message(errno));
  const std::unique_ptr<EVP_MD_CTX, void (*)(EVP_MD_CTX*)> context(EVP_MD_CTX_new(),
                                                                   EVP_MD_CTX_free);
  EVP_DigestInit_ex(context.get(), EVP_sha256(), nullptr);
  std::string chunk(kReadBytes, '\0');
  while (in.read(chunk.data(), kReadBytes) || in.gcount() > 0) {
    if (interrupt.raised()) return absl::CancelledError("interrupted");
    EVP_DigestUpdate(context.get(), chunk.data(), static_cast<size_t>(in.gcount()));
  }
  if (in.bad()) return Unreadable(path, "read error");
  EVP_DigestUpdate(context.get(), tail.data(), tail.size());
  std::string digest(32, '\0');
  EVP_DigestFinal_ex(context.get(), reinterpret_cast<unsigned char*>(digest.data()), nullptr);
  return digest;
}

}  // namespace litags::client
