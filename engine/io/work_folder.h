// Folders that a run writes into. Errors: FAILED_PRECONDITION (FOLDER_NOT_WRITABLE), naming
// "work_dir" and the path.
#ifndef LITAGS_ENGINE_IO_WORK_FOLDER_H_
#define LITAGS_ENGINE_IO_WORK_FOLDER_H_

#include <filesystem>

#include "absl/status/status.h"

namespace litags {

// The folder and its parents, made if missing.
absl::Status MakeFolder(const std::filesystem::path& dir);

// The same, and empty: what is there goes.
absl::Status MakeEmptyFolder(const std::filesystem::path& dir);

// LinkFile (link_file.h) to a place in such a folder.
absl::Status LinkInWorkDir(const std::filesystem::path& target, const std::filesystem::path& link);

}  // namespace litags

#endif  // LITAGS_ENGINE_IO_WORK_FOLDER_H_
