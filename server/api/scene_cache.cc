#include "server/api/scene_cache.h"

#include <sys/stat.h>

#include <filesystem>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "server/api/status.h"
#include "server/jobs/state_machine.h"

namespace litags {
namespace {

absl::StatusOr<int64_t> StampOf(const std::string& path) {
  struct stat info = {};
  if (stat(path.c_str(), &info) != 0) {
    return MakeError(absl::StatusCode::kInternal, "SCENE_MISSING", "",
                     "the job's scene is gone from the server's disk; resume or rerun the job");
  }
  // A replaced file has another inode or another time, mostly both.
  return (int64_t{info.st_mtim.tv_sec} * 1'000'000'000 + info.st_mtim.tv_nsec) ^
         static_cast<int64_t>(info.st_ino << 1);
}

}  // namespace

absl::StatusOr<std::shared_ptr<const Scene>> SceneCache::Get(Jobs* jobs, const std::string& name) {
  LITAGS_ASSIGN_OR_RETURN(const std::string id, ParseJobName(name));
  LITAGS_ASSIGN_OR_RETURN(const JobRecord job, jobs->Get(id));
  if (job.scene_path.empty()) {
    return MakeError(absl::StatusCode::kFailedPrecondition, "SCENE_NOT_READY", "name",
                     absl::StrCat("the job is ", std::string(JobStateName(job.state)),
                                  " and has no snapshot yet; WatchJob tells when there is one"));
  }
  const std::string path = jobs->data().FromStored(job.scene_path);
  LITAGS_ASSIGN_OR_RETURN(int64_t stamp, StampOf(path));
  if (auto scene = Find(path, stamp)) return scene;

  std::lock_guard load_lock(load_mutex_);
  LITAGS_ASSIGN_OR_RETURN(stamp, StampOf(path));
  if (auto scene = Find(path, stamp)) return scene;
  LITAGS_ASSIGN_OR_RETURN(auto scene, engine_->LoadScene(path));
  std::lock_guard lock(mutex_);
  entries_.remove_if([&](const Entry& entry) { return entry.path == path; });
  entries_.push_front({path, stamp, scene});
  if (entries_.size() > capacity_) entries_.pop_back();
  return scene;
}

std::shared_ptr<const Scene> SceneCache::Find(const std::string& path, int64_t stamp) {
  std::lock_guard lock(mutex_);
  for (auto it = entries_.begin(); it != entries_.end(); ++it) {
    if (it->path != path || it->stamp != stamp) continue;
    entries_.splice(entries_.begin(), entries_, it);
    return it->scene;
  }
  return nullptr;
}

}  // namespace litags
