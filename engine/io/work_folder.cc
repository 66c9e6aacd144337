#include "engine/io/work_folder.h"

#include <string>
#include <system_error>
#include <vector>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/io/file_util.h"
#include "engine/io/link_file.h"

namespace litags {
namespace {

namespace fs = std::filesystem;

absl::Status Written(const fs::path& path, const std::error_code& error) {
  if (!error) return absl::OkStatus();
  return MakeError(absl::StatusCode::kFailedPrecondition, "FOLDER_NOT_WRITABLE", "work_dir",
                   absl::StrCat("cannot write ", path.string(), ": ", error.message(),
                                "; check its place and its permissions"));
}

// What lies in the folder but the marker and files that were being written.
absl::StatusOr<std::vector<std::string>> NamesInside(const fs::path& dir) {
  return ListNames(dir, "work_dir", [](const fs::directory_entry& entry) {
    const std::string name = entry.path().filename();
    return name != kOwnFolderMarker && !name.ends_with(kTempSuffix);
  });
}

}  // namespace

absl::Status CheckOwnFolder(const fs::path& dir) {
  std::error_code ignored;  // writing says what is wrong
  if (!fs::exists(fs::symlink_status(dir, ignored))) return absl::OkStatus();
  if (fs::exists(dir / kOwnFolderMarker, ignored)) return absl::OkStatus();
  if (fs::is_directory(dir, ignored)) {
    LITAGS_ASSIGN_OR_RETURN(const std::vector<std::string> names, NamesInside(dir));
    if (names.empty()) return absl::OkStatus();
  }
  return MakeError(
      absl::StatusCode::kFailedPrecondition, "FOLDER_NOT_OURS", "work_dir",
      absl::StrCat(dir.string(), " is where this run writes, and may not be of litags: it has no ",
                   "file ", kOwnFolderMarker, "; name another output folder, or move it away; ",
                   "if an older litags made it, put an empty file ", kOwnFolderMarker, " there"));
}

absl::Status MakeFolder(const fs::path& dir) {
  std::error_code error;
  fs::create_directories(dir, error);
  return Written(dir, error);
}

absl::Status MakeOwnFolder(const fs::path& dir) {
  LITAGS_RETURN_IF_ERROR(CheckOwnFolder(dir));
  LITAGS_RETURN_IF_ERROR(MakeFolder(dir));
  std::error_code ignored;  // writing says what is wrong
  const fs::path marker = dir / kOwnFolderMarker;
  if (fs::exists(marker, ignored)) return absl::OkStatus();
  return WriteFileAtomically(marker, "litags made this folder, and may delete what lies in it.\n");
}

// The marker stays, or a run that is killed here would leave files without it.
absl::Status MakeEmptyFolder(const fs::path& dir) {
  std::error_code error;
  LITAGS_RETURN_IF_ERROR(CheckOwnFolder(dir));
  if (fs::is_symlink(dir, error)) fs::remove(dir, error);  // what it points to stays
  LITAGS_RETURN_IF_ERROR(MakeOwnFolder(dir));
  RemoveStaleTempFiles(dir);
  LITAGS_ASSIGN_OR_RETURN(const std::vector<std::string> names, NamesInside(dir));
  for (const std::string& name : names) {
    fs::remove_all(dir / name, error);
    if (error) return Written(dir / name, error);
  }
  return absl::OkStatus();
}

absl::Status LinkInWorkDir(const fs::path& target, const fs::path& link) {
  return Written(link, LinkFile(target, link));
}

}  // namespace litags
