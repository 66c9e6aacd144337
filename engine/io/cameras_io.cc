#include "engine/io/cameras_io.h"

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <set>
#include <utility>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_join.h"
#include "engine/core/limits.h"
#include "engine/core/utf8.h"
#include "engine/io/bundler_io.h"
#include "engine/io/colmap_io.h"
#include "engine/io/file_util.h"
#include "engine/io/io_error.h"
#include "engine/io/meshroom_io.h"
#include "engine/io/metashape_io.h"
#include "engine/io/model_util.h"
#include "engine/io/openmvg_io.h"
#include "engine/io/transforms_io.h"

namespace litags {
namespace {

namespace fs = std::filesystem;

// Files of cameras as their programs name them.
constexpr const char* kFileNames[] = {"transforms.json", "sfm_data.json", "cameras.sfm",
                                      "cameras.xml", "bundle.out"};

bool IsColmapModel(const fs::path& dir) {
  std::error_code ignored;
  return fs::exists(dir / "cameras.bin", ignored) || fs::exists(dir / "cameras.txt", ignored);
}

// How many images a COLMAP model says that it has: the number that images.bin begins with, else the
// lines of images.txt that end in a name. client/cameras_source.cc has the same rule.
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
  std::vector<fs::path> found;
  if (IsColmapModel(dir)) found.push_back(dir);
  const auto inner = ListNames(
      dir, "", [](const fs::directory_entry& entry) { return IsColmapModel(entry.path()); });
  if (inner.ok()) {
    for (const std::string& name : *inner) found.push_back(dir / name);
  }
  const auto largest = std::max_element(
      found.begin(), found.end(),
      [](const fs::path& a, const fs::path& b) { return ImagesOf(a) < ImagesOf(b); });
  return largest == found.end() ? fs::path() : *largest;
}

// Whose file this is that is not read, by its first line; empty: nobody's that is known.
std::string_view OtherProgramOf(std::string_view text) {
  text = WithoutByteOrderMark(text);
  const std::string_view line = text.substr(0, text.find('\n'));
  if (line.starts_with("NVM_V")) return "VisualSFM";
  if (line.starts_with("#name,")) return "RealityScan (RealityCapture), as CSV,";
  return "";
}

// What is too large has points, which are not read.
absl::StatusOr<std::string> ReadCamerasFile(const std::string& path, std::string_view field) {
  absl::StatusOr<std::string> text = ReadFile(path, field, kMaxCamerasBytes);
  const auto detail = GetErrorDetail(text.status());
  if (!detail || detail->reason != "FILE_TOO_LARGE") return text;
  return InvalidInput(detail->reason, detail->field,
                      absl::StrCat(text.status().message(), ": export the cameras without points"));
}

PhotoSizes OneSize(int width, int height) {
  return [=](const std::string&) { return PhotoSize{width, height}; };
}

}  // namespace

bool IsCamerasFileName(std::string_view name) {
  return std::any_of(std::begin(kFileNames), std::end(kFileNames),
                     [&](const char* known) { return name == known; });
}

std::string ResolveCameras(const std::string& path) {
  const fs::path dir(path);
  std::error_code ignored;
  if (!fs::is_directory(dir, ignored) || IsColmapModel(dir)) return path;
  if (const fs::path model = LargestModel(dir / "sparse"); !model.empty()) return model;
  for (const char* name : kFileNames) {
    if (fs::is_regular_file(dir / name, ignored)) return dir / name;
  }
  for (const fs::path& parent : {dir, dir / "colmap/sparse", dir / "colmap"}) {
    if (const fs::path model = LargestModel(parent); !model.empty()) return model;
  }
  return path;
}

absl::StatusOr<SparseModel> ParseCameras(std::string_view text, std::string_view field,
                                         const PhotoSizes& sizes, PanoramaNames* panoramas) {
  if (const std::string_view program = OtherProgramOf(text); !program.empty()) {
    return InvalidField("UNSUPPORTED_CAMERA_FILE", field,
                        absl::StrCat("cameras of ", Absl(program),
                                     " are not read; export them as a COLMAP model, or as "
                                     "transforms.json"));
  }
  if (IsBundler(text)) return ParseBundler(text, field, sizes);
  if (IsXml(text)) return ParseMetashape(text, field, panoramas);
  if (IsOpenMvg(text)) return ParseOpenMvg(text, field, panoramas);
  if (IsMeshroom(text)) return ParseMeshroom(text, field);
  return ParseTransforms(text, field, sizes, panoramas);
}

absl::StatusOr<std::vector<std::string>> CheckCameras(std::string_view text,
                                                      std::string_view field) {
  PanoramaNames panoramas;
  // Large, so that it shows all points that Bundler's cameras see.
  const PhotoSizes sizes = OneSize(kMaxCameraSide, kMaxCameraSide);
  LITAGS_ASSIGN_OR_RETURN(SparseModel model, ParseCameras(text, field, sizes, &panoramas));
  return std::move(model.paths);
}

absl::StatusOr<SparseModel> ReadCameras(const std::string& path, std::string_view field,
                                        const PhotoSizes& sizes, PanoramaNames* panoramas,
                                        std::set<std::string>* sure) {
  std::error_code ignored;
  if (fs::is_directory(path, ignored) && !IsColmapModel(path)) {
    return InvalidField("NO_CAMERAS_IN_FOLDER", field,
                        absl::StrCat("the folder '", path, "' has neither a COLMAP model ",
                                     "(cameras.bin, images.bin; in it, in sparse or in a folder ",
                                     "of these) nor ", absl::StrJoin(kFileNames, ", "),
                                     "; give the file or the folder of the cameras"));
  }
  if (fs::is_directory(path, ignored)) return ReadColmapModel(path, field);
  LITAGS_ASSIGN_OR_RETURN(std::string text, ReadCamerasFile(path, field));
  if (IsBundler(text)) {
    if (const std::string list = BundlerListOf(path); !list.empty()) {
      LITAGS_ASSIGN_OR_RETURN(const std::string names, ReadFile(list, field, kMaxCamerasBytes));
      absl::StrAppend(&text, "\n", names);
    }
    return ParseBundler(text, field, sizes, sure);
  }
  return ParseCameras(text, field, sizes, panoramas);
}

absl::StatusOr<SparseModel> ReadCameras(const std::string& path, std::string_view field,
                                        int default_width, int default_height) {
  return ReadCameras(path, field, OneSize(default_width, default_height));
}

}  // namespace litags
