#include "server/worker/lease_folder.h"

#include <charconv>
#include <filesystem>
#include <map>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "server/store/file_error.h"

namespace litags {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kPrefix = "lease-";

// The lease folders that are there, by number.
std::map<int64_t, fs::path> LeaseFolders(const fs::path& work, std::error_code& error) {
  std::map<int64_t, fs::path> folders;
  for (fs::directory_iterator it(work, error), end; !error && it != end; it.increment(error)) {
    const std::string name = it->path().filename();
    if (!name.starts_with(kPrefix)) continue;
    int64_t number = -1;
    std::from_chars(name.data() + kPrefix.size(), name.data() + name.size(), number);
    folders[number] = it->path();
  }
  return folders;
}

}  // namespace

absl::StatusOr<std::string> TakeLeaseFolder(const Lease& lease, const DataDir& data) {
  const int64_t number = lease.job.last_event;
  const fs::path work = data.work(lease.job.id);
  const fs::path mine = work / absl::StrCat(std::string(kPrefix), number);
  std::error_code error;
  fs::create_directories(work, error);
  std::map<int64_t, fs::path> folders;
  if (!error) folders = LeaseFolders(work, error);
  if (error) return FileError("prepare", work, error.value());
  if (!folders.empty() && folders.rbegin()->first > number) {
    return MakeError(absl::StatusCode::kAborted, "LEASE_LOST", "",
                     absl::StrCat("a later lease works on jobs/", lease.job.id));
  }
  if (!folders.empty() && folders.rbegin()->first < number) {
    fs::rename(folders.rbegin()->second, mine, error);
  } else if (fs::exists(work / "run")) {  // of before there were lease folders
    fs::create_directories(mine, error);
    if (!error) fs::rename(work / "run", mine / "run", error);
  }
  if (!error) fs::create_directories(mine / "run", error);
  if (error) return FileError("prepare", mine, error.value());
  // An interrupted worker may have come after its successor and left an empty one.
  for (const auto& [other, path] : folders) {
    if (other < number) fs::remove_all(path, error);
  }
  return mine.string();
}

}  // namespace litags
