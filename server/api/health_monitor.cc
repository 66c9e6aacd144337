#include "server/api/health_monitor.h"

#include <spdlog/spdlog.h>
#include <sys/statvfs.h>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "server/store/file_error.h"

namespace litags {
namespace {

// Less than this, and the next photo or checkpoint will not fit.
constexpr uint64_t kLeastFreeBytes = uint64_t{16} << 20;

absl::Status CheckFolder(const StorePlaces::Folder& folder) {
  struct statvfs info = {};
  if (statvfs(folder.path.c_str(), &info) != 0) {
    return MakeError(absl::StatusCode::kInternal, "STORE_FAILED", folder.flag,
                     absl::StrCat("cannot look at the file system of ", folder.path));
  }
  if (info.f_flag & ST_RDONLY) {
    return MakeError(absl::StatusCode::kFailedPrecondition, "STORE_READ_ONLY", folder.flag,
                     absl::StrCat(folder.path, " can only be read; mount it for writing"));
  }
  const uint64_t free = uint64_t{info.f_bavail} * info.f_frsize;
  if (free < kLeastFreeBytes) {
    return MakeError(absl::StatusCode::kResourceExhausted, "DISK_FULL", folder.flag,
                     absl::StrCat(free >> 20, " MiB are free in ", folder.path, ", fewer than ",
                                  kLeastFreeBytes >> 20, "; delete jobs or make room"));
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status CheckStoreHealth(Jobs* jobs, const LocalFolders& folders) {
  LITAGS_RETURN_IF_ERROR(jobs->List(0, "", 1).status());
  LITAGS_RETURN_IF_ERROR(jobs->CheckWritable());
  for (const StorePlaces::Folder& folder : folders) LITAGS_RETURN_IF_ERROR(CheckFolder(folder));
  return absl::OkStatus();
}

HealthMonitor::HealthMonitor(Jobs* jobs, LocalFolders folders, std::function<bool()> workers_fail,
                             Server* server, double interval_seconds)
    : jobs_(jobs),
      folders_(std::move(folders)),
      workers_fail_(std::move(workers_fail)),
      server_(server),
      thread_([this, interval_seconds] { Loop(interval_seconds); }) {}

HealthMonitor::~HealthMonitor() {
  stop_.Cancel();
  thread_.join();
}

void HealthMonitor::Loop(double interval_seconds) {
  while (!stop_.IsCancelled()) {
    Look();
    stop_.SleepFor(interval_seconds);
  }
}

void HealthMonitor::Look() {
  const absl::Status store = CheckStoreHealth(jobs_, folders_);
  server_->metrics()->AddIfStoreError(store);
  const Health now{store.ok(), !workers_fail_()};
  if (now.store != last_.store) {
    if (now.store) {
      spdlog::info("health: the store is well again");
    } else {
      spdlog::error("health: the store fails: {}", MessageWithReason(store));
    }
  }
  if (now.workers != last_.workers) {
    if (now.workers) {
      spdlog::info("health: workers last again");
    } else {
      spdlog::error("health: all workers end as soon as they start; what they log says why");
    }
  }
  last_ = now;
  server_->SetHealth(now);
}

}  // namespace litags
