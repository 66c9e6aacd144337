#include "server/api/upload_files.h"

#include <algorithm>
#include <string_view>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/types/span.h"
#include "engine/core/error.h"
#include "engine/core/photo_names.h"
#include "engine/io/file_util.h"
#include "proto/litags/v1/limits.h"
#include "server/store/digest.h"

namespace litags {
namespace {

struct RoleRules {
  const char* field;                              // "images"
  absl::Span<const std::string_view> extensions;  // of names, lower case
};

RoleRules RulesOf(FileRole role) {
  switch (role) {
    case FileRole::kCameras:
      return {"cameras", v1::kCamerasEndings};
    case FileRole::kDepth:
      return {"depths", v1::kDepthEndings};
    case FileRole::kColmap:
      return {"colmap", v1::kColmapEndings};
    case FileRole::kArchive:
      return {"archives", v1::kArchiveEndings};
    case FileRole::kMask:
      return {"masks", v1::kMaskEndings};
    case FileRole::kVideo:
      return {"videos", v1::kVideoEndings};
    case FileRole::kPhoto:
      break;
  }
  return {"images", v1::kPhotoEndings};
}

constexpr const char* kColmapNames[] = {"cameras.bin", "images.bin", "points3D.bin",
                                        "cameras.txt", "images.txt", "points3D.txt"};

bool IsColmapName(const std::string& name) {
  return std::any_of(std::begin(kColmapNames), std::end(kColmapNames),
                     [&](const char* n) { return name == n; });
}

// As their programs name them: transforms_train.json, sfm_data.json, cameras.sfm, cameras.xml.
// Other files of these endings may be anything.
bool HasNameOfCameras(const std::string& name) {
  const bool json = name.ends_with(".json");
  if (name.starts_with("transforms") || name.starts_with("sfm_data")) return json;
  return name.starts_with("cameras") && (name.ends_with(".sfm") || name.ends_with(".xml"));
}

void AppendEnding(std::string* out, std::string_view ending) { out->append(ending); }

bool HasExtension(const std::string& name, FileRole role) {
  if (role == FileRole::kDepth) {  // as the engine finds them
    const std::vector<std::string> names = DepthMapNames(WithoutEnding(name));
    return std::find(names.begin(), names.end(), name) != names.end();
  }
  const std::string lower = absl::AsciiStrToLower(name);
  for (const std::string_view extension : RulesOf(role).extensions) {
    if (lower.size() > extension.size() && lower.ends_with(extension)) return true;
  }
  return false;
}

int64_t LimitOf(FileRole role, const UploadLimits& limits) {
  if (role == FileRole::kCameras) return limits.max_cameras_bytes;
  if (role == FileRole::kVideo) return std::min(limits.max_video_bytes, limits.max_job_bytes);
  if (role == FileRole::kArchive) return limits.max_job_bytes;
  if (role == FileRole::kColmap) return kMaxColmapBytes;
  return limits.max_file_bytes;
}

// What to do about a file that is larger.
const char* RemedyOf(FileRole role) {
  if (role == FileRole::kCameras) return "export the cameras without points";
  if (role == FileRole::kColmap) {
    return "export the model with fewer features of each photo, or give a transforms.json";
  }
  return "make the file smaller";
}

// The innermost folder of these names tells what its files and folders are: masks/cam0/0001.png is
// a mask, as images/cam0/masks/0001.png is.
FileRole RoleOfFolders(const std::vector<std::string>& folders) {
  for (auto folder = folders.rbegin(); folder != folders.rend(); ++folder) {
    const std::string name = absl::AsciiStrToLower(*folder);
    if (name == "mask" || name == "masks") return FileRole::kMask;
    if (name == "depth" || name == "depths") return FileRole::kDepth;
    if (name == "images") break;
  }
  return FileRole::kPhoto;
}

}  // namespace

std::string FieldOf(FileRole role, const std::string& name) {
  return absl::StrCat(RulesOf(role).field, "[", name, "]");
}

absl::Status CheckSize(FileRole role, int64_t bytes, const UploadLimits& limits,
                       const std::string& field) {
  const int64_t limit = LimitOf(role, limits);
  if (bytes <= limit) return absl::OkStatus();
  return MakeError(absl::StatusCode::kResourceExhausted, "FILE_TOO_LARGE", field,
                   absl::StrCat(field, ": ", bytes, " bytes exceed ", limit, "; ", RemedyOf(role)));
}

int64_t MaxEntryBytes(const UploadLimits& limits) {
  return std::max(limits.max_file_bytes, kMaxColmapBytes);
}

absl::Status CheckName(const std::string& name, FileRole role, const std::string& field) {
  LITAGS_RETURN_IF_ERROR(ValidateFileName(name, field));
  if (role == FileRole::kColmap && !IsColmapName(name)) {
    return InvalidInput("BAD_FILE_NAME", field,
                        absl::StrCat(field, ": the files of a COLMAP model are named ",
                                     absl::StrJoin(kColmapNames, ", ")));
  }
  if (name.front() != '.' && HasExtension(name, role)) return absl::OkStatus();
  return InvalidInput("BAD_FILE_NAME", field,
                      absl::StrCat(field, ": the name must end in one of ",
                                   absl::StrJoin(RulesOf(role).extensions, ", ", AppendEnding),
                                   " and not begin with a dot; rename the file"));
}

absl::StatusOr<FileRole> ParseFileRole(v1::FileRole role, const char* field) {
  if (!v1::FileRole_IsValid(role)) {
    return InvalidInput("FILE_ROLE_UNKNOWN", field,
                        absl::StrCat("the server does not know file role ", role));
  }
  return role == v1::FILE_ROLE_UNSPECIFIED ? FileRole::kPhoto : static_cast<FileRole>(role);
}

absl::StatusOr<UploadHeader> ParseFileHeader(const v1::FileHeader& header,
                                             const UploadLimits& limits) {
  UploadHeader file;
  file.record.name = header.file_name();
  file.record.size_bytes = header.size_bytes();
  file.record.sha256 = ToHex(header.sha256());
  LITAGS_ASSIGN_OR_RETURN(file.record.role, ParseFileRole(header.role(), "file.role"));
  file.field = FieldOf(file.record.role, header.file_name());
  LITAGS_RETURN_IF_ERROR(CheckName(header.file_name(), file.record.role, file.field));
  if (header.size_bytes() <= 0) {
    return InvalidInput("FILE_EMPTY", file.field,
                        absl::StrCat(file.field,
                                     ": the file has no bytes; leave it out or copy it "
                                     "from the camera again"));
  }
  LITAGS_RETURN_IF_ERROR(CheckSize(file.record.role, header.size_bytes(), limits, file.field));
  if (header.sha256().size() != 32) {
    return InvalidInput("FILE_DIGEST_MISSING", file.field,
                        absl::StrCat(file.field, ": sha256 has ", header.sha256().size(),
                                     " bytes; it must have 32"));
  }
  if (header.offset() < 0) {
    return InvalidInput("OFFSET_NEGATIVE", file.field,
                        absl::StrCat(file.field, ": offset is ", header.offset(),
                                     "; it counts bytes from the start of the file"));
  }
  if (header.offset() > header.size_bytes()) {
    return InvalidInput(
        "FILE_SIZE_MISMATCH", file.field,
        absl::StrCat(file.field, ": offset ", header.offset(),
                     " lies beyond the end of the file of ", header.size_bytes(), " bytes"));
  }
  return file;
}

std::optional<FileRole> RoleInArchive(const ArchiveEntry& entry) {
  if (entry.name.starts_with(".")) return std::nullopt;
  for (const std::string& f : entry.folders) {
    if (f.starts_with(".") || f == "__MACOSX") return std::nullopt;
  }
  const FileRole role = RoleOfFolders(entry.folders);
  if (role != FileRole::kPhoto) {
    return HasExtension(entry.name, role) ? std::optional(role) : std::nullopt;
  }
  // Text files of these names may be anything, save where COLMAP's are.
  const auto is_colmap_folder = [](const std::string& f) {
    const std::string lower = absl::AsciiStrToLower(f);
    return lower.starts_with("sparse") || lower.starts_with("colmap");
  };
  if (IsColmapName(entry.name) &&
      (entry.name.ends_with(".bin") ||
       std::any_of(entry.folders.begin(), entry.folders.end(), is_colmap_folder))) {
    return FileRole::kColmap;
  }
  if (HasNameOfCameras(entry.name)) return FileRole::kCameras;
  if (HasExtension(entry.name, FileRole::kPhoto)) return FileRole::kPhoto;
  return std::nullopt;
}

}  // namespace litags
