// Folders that a run makes in its output folder. Each holds a marker, and none is written into, or
// cleared, that holds other files and no marker: those are the user's. Errors: FAILED_PRECONDITION
// (FOLDER_NOT_WRITABLE, FOLDER_NOT_OURS), naming "work_dir" and the path, and those of ListNames
// and WriteFileAtomically.
#ifndef LITAGS_ENGINE_IO_WORK_FOLDER_H_
#define LITAGS_ENGINE_IO_WORK_FOLDER_H_

#include <filesystem>

#include "absl/status/status.h"

namespace litags {

// The marker's name.
inline constexpr char kOwnFolderMarker[] = ".litags";

// That a run may make this folder, or has made it. FOLDER_NOT_OURS.
absl::Status CheckOwnFolder(const std::filesystem::path& dir);

// The folder and its parents, made if missing, without a marker: for what lies in one that has it.
absl::Status MakeFolder(const std::filesystem::path& dir);

// The folder with its marker, made if missing. FOLDER_NOT_OURS.
absl::Status MakeOwnFolder(const std::filesystem::path& dir);

// The same, and else empty: what is there goes.
absl::Status MakeEmptyFolder(const std::filesystem::path& dir);

// LinkFile (link_file.h) to a place in such a folder.
absl::Status LinkInWorkDir(const std::filesystem::path& target, const std::filesystem::path& link);

}  // namespace litags

#endif  // LITAGS_ENGINE_IO_WORK_FOLDER_H_
