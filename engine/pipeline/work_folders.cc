#include "engine/pipeline/work_folders.h"

#include <sys/file.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <iterator>
#include <system_error>
#include <vector>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/io/work_folder.h"

namespace litags {
namespace {

namespace fs = std::filesystem;

// Without links and "..", and without an empty last part. Where a folder may not be read, links
// stay: who uses the path says what is wrong.
fs::path Resolved(const fs::path& path) {
  std::error_code error;
  const fs::path absolute = fs::absolute(path, error);
  fs::path whole = fs::weakly_canonical(absolute, error);
  if (error) whole = absolute.lexically_normal();
  return whole.has_filename() ? whole : whole.parent_path();
}

bool LiesIn(const fs::path& path, const fs::path& folder) {
  return std::mismatch(folder.begin(), folder.end(), path.begin(), path.end()).first ==
         folder.end();
}

}  // namespace

absl::Status CheckOutside(const std::string& work_dir, absl::Span<const absl::string_view> folders,
                          absl::Span<const std::string> inputs) {
  for (const absl::string_view name : folders) {
    const fs::path folder = Resolved(fs::path(work_dir) / std::string(name));
    for (const std::string& input : inputs) {
      if (input.empty() || !LiesIn(Resolved(input), folder)) continue;
      return InvalidInput("INPUT_IN_WORK_DIR", "work_dir",
                          absl::StrCat(input, " lies in ", folder.string(),
                                       ", where this run writes: name another output folder"));
    }
  }
  return absl::OkStatus();
}

absl::Status CheckOwnFolders(const std::string& work_dir,
                             absl::Span<const absl::string_view> folders) {
  for (const absl::string_view name : folders) {
    LITAGS_RETURN_IF_ERROR(CheckOwnFolder(fs::path(work_dir) / std::string(name)));
  }
  return absl::OkStatus();
}

absl::Status CheckWorkDir(const ReconstructInput& input) {
  if (input.work_dir.empty()) {
    return InvalidInput("WORK_DIR_MISSING", "work_dir",
                        "no output folder is named; name one, \".\" for the current folder");
  }
  constexpr absl::string_view kFolders[] = {
      "photos", "found_masks", "sfm", "wide_views", "wide_views_2", "cameras", "solved_fisheyes"};
  std::vector<absl::string_view> written(std::begin(kFolders), std::end(kFolders));
  if (!input.video_path.empty()) written.push_back("frames");
  const std::string inputs[] = {input.images_dir, input.video_path, input.cameras_path,
                                input.depth_dir, input.masks_dir};
  LITAGS_RETURN_IF_ERROR(CheckOutside(input.work_dir, written, inputs));
  return CheckOwnFolders(input.work_dir, kFolders);
}

absl::StatusOr<FolderLock> LockWorkDir(const std::string& work_dir) {
  FolderLock folder(opendir(work_dir.c_str()), closedir);
  // Who cannot open it, or lock folders there, goes on: the run says what is wrong.
  if (folder != nullptr && flock(dirfd(folder.get()), LOCK_EX | LOCK_NB) != 0 &&
      errno == EWOULDBLOCK) {
    return MakeError(absl::StatusCode::kFailedPrecondition, "WORK_DIR_IN_USE", "work_dir",
                     absl::StrCat("another run is in ", work_dir,
                                  ": wait for its end, or name another output folder"));
  }
  return folder;
}

}  // namespace litags
