#include "server/store/data_dir.h"

#include <filesystem>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"

namespace litags {

namespace fs = std::filesystem;

absl::StatusOr<DataDir> DataDir::Open(const std::string& root) {
  std::error_code error;
  const fs::path absolute = fs::absolute(root, error).lexically_normal();
  DataDir dir{absolute.string()};
  if (!error) fs::create_directories(absolute / "work", error);
  if (!error) fs::create_directories(absolute / "tmp", error);
  if (!error) fs::permissions(absolute, fs::perms::owner_all, error);
  if (error) {
    return MakeError(absl::StatusCode::kFailedPrecondition, "DATA_DIR_UNUSABLE", "data",
                     absl::StrCat("cannot use ", dir.root, " as the data folder: ", error.message(),
                                  "; choose another or fix its permissions"));
  }
  return dir;
}

void DataDir::EmptyTmp() const {
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(tmp(), error)) fs::remove_all(entry, error);
}

}  // namespace litags
