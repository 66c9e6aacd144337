// A run writes into folders in its work_dir, and clears most of them before: what the user gave
// must not lie there, nor other files of the user's (engine/io/work_folder.h), and no other run may
// be in it.
#ifndef LITAGS_ENGINE_PIPELINE_WORK_FOLDERS_H_
#define LITAGS_ENGINE_PIPELINE_WORK_FOLDERS_H_

#include <dirent.h>

#include <memory>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "absl/types/span.h"
#include "engine/pipeline/engine.h"

namespace litags {

// That none of `inputs` (files or folders; empty ones are none) is, or lies in, a folder of
// `work_dir` of these names. INVALID_ARGUMENT (INPUT_IN_WORK_DIR).
absl::Status CheckOutside(const std::string& work_dir, absl::Span<const absl::string_view> folders,
                          absl::Span<const std::string> inputs);

// CheckOwnFolder of all these folders of `work_dir`.
absl::Status CheckOwnFolders(const std::string& work_dir,
                             absl::Span<const absl::string_view> folders);

// Both, of all that a run reads and all folders that it writes into; WithFramesAsPhotos checks
// whose the frames are, which may be kept. INVALID_ARGUMENT (WORK_DIR_MISSING) if work_dir is
// empty.
absl::Status CheckWorkDir(const ReconstructInput& input);

// Holds the lock of a folder. It leaves no file there, ends with the process, and is no child's.
using FolderLock = std::unique_ptr<DIR, int (*)(DIR*)>;

// FAILED_PRECONDITION (WORK_DIR_IN_USE) if somebody has it, this process too. Folders on network
// drives are locked for one machine.
absl::StatusOr<FolderLock> LockWorkDir(const std::string& work_dir);

}  // namespace litags

#endif  // LITAGS_ENGINE_PIPELINE_WORK_FOLDERS_H_
