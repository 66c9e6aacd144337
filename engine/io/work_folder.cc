#include "engine/io/work_folder.h"

#include <system_error>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
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

}  // namespace

absl::Status MakeFolder(const fs::path& dir) {
  std::error_code error;
  fs::create_directories(dir, error);
  return Written(dir, error);
}

absl::Status MakeEmptyFolder(const fs::path& dir) {
  std::error_code error;
  fs::remove_all(dir, error);
  if (error) return Written(dir, error);
  return MakeFolder(dir);
}

absl::Status LinkInWorkDir(const fs::path& target, const fs::path& link) {
  return Written(link, LinkFile(target, link));
}

}  // namespace litags
