#include "server/api/scene_cache.h"

#include <unistd.h>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "server/api/status.h"
#include "server/jobs/state_machine.h"
#include "server/store/digest.h"

namespace litags {
namespace {

// A running job replaces its snapshot, and removes the one before, now and then.
constexpr int kTries = 5;

}  // namespace

std::optional<SceneCache::Result> SceneCache::Get(Call& call, const CancelToken& cancel,
                                                  const std::string& name, Snapshot* snapshot,
                                                  std::function<void(const Result&)> then) {
  const auto id = ParseJobName(name);
  if (!id.ok()) return id.status();
  if (*snapshot) {
    if (const auto entry = Find(*id, **snapshot)) return entry->scene;
  }
  const auto file = NewestOf(call.jobs(), *id);
  if (!file.ok()) return file.status();
  if (const auto entry = Find(*id, *file)) {
    *snapshot = entry->snapshot;
    return entry->scene;
  }
  const int64_t asked = [&] {
    std::lock_guard lock(mutex_);
    return ++asked_;
  }();
  const auto load = [=, this, id = *id, &call, &cancel, then = std::move(then)] {
    absl::StatusOr<Entry> entry = CallCancelled();
    if (!cancel.IsCancelled()) entry = LoadNewest(call.jobs(), id, asked);
    {
      std::lock_guard lock(mutex_);
      if (++ended_ == asked_) failures_.clear();
    }
    if (entry.ok()) *snapshot = entry->snapshot;
    then(entry.ok() ? Result(entry->scene) : Result(entry.status()));
  };
  const absl::Status accepted = loads_->Try(call.client().name, load);
  if (accepted.ok()) return std::nullopt;
  std::lock_guard lock(mutex_);
  ++ended_;
  return accepted;
}

absl::StatusOr<KeptFile> SceneCache::NewestOf(Jobs* jobs, const std::string& id) {
  LITAGS_ASSIGN_OR_RETURN(const JobRecord job, jobs->Get(id));
  LITAGS_ASSIGN_OR_RETURN(const auto file, Jobs::SceneOf(job));
  if (file) return *file;
  if (IsTerminal(job.state)) {
    return MakeError(absl::StatusCode::kFailedPrecondition, "SCENE_NOT_MADE", "name",
                     job.state == JobState::kFailed
                         ? "the job FAILED and made no scene; see its error, or resume it"
                         : absl::StrCat("the job is ", std::string(JobStateName(job.state)),
                                        " and made no scene; resume it"));
  }
  return MakeError(absl::StatusCode::kFailedPrecondition, "SCENE_NOT_READY", "name",
                   absl::StrCat("the job is ", std::string(JobStateName(job.state)),
                                " and has no snapshot yet; WatchJob tells when there is one"));
}

absl::StatusOr<SceneCache::Entry> SceneCache::LoadNewest(Jobs* jobs, const std::string& id,
                                                         int64_t asked) {
  {
    // Whoever waited for a load that failed does not begin the next one.
    std::lock_guard lock(mutex_);
    const auto failure = failures_.find(id);
    if (failure != failures_.end() && failure->second.asked >= asked) return failure->second.status;
  }
  for (int attempt = 1;; ++attempt) {
    LITAGS_ASSIGN_OR_RETURN(const KeptFile file, NewestOf(jobs, id));
    if (auto entry = Find(id, file)) return *std::move(entry);
    auto scene = Load(jobs, id, file);
    if (scene.ok()) {
      Entry entry{id, std::make_shared<const KeptFile>(file), *std::move(scene)};
      Add(entry);
      return entry;
    }
    if (absl::IsNotFound(scene.status()) && attempt < kTries) continue;
    std::lock_guard lock(mutex_);
    failures_[id] = {asked_, scene.status()};
    return scene.status();
  }
}

absl::StatusOr<std::shared_ptr<const Scene>> SceneCache::Load(Jobs* jobs, const std::string& job,
                                                              const KeptFile& file) {
  const std::string path = absl::StrCat(jobs->data().tmp(), "/scene-", RandomHex(8));
  LITAGS_RETURN_IF_ERROR(jobs->FetchKept(job, file, path));
  auto scene = engine_->LoadScene(path);
  unlink(path.c_str());
  return scene;
}

std::optional<SceneCache::Entry> SceneCache::Find(const std::string& job, const KeptFile& file) {
  std::lock_guard lock(mutex_);
  for (auto it = entries_.begin(); it != entries_.end(); ++it) {
    if (it->job != job || *it->snapshot != file) continue;
    entries_.splice(entries_.begin(), entries_, it);
    return *it;
  }
  return std::nullopt;
}

void SceneCache::Add(Entry added) {
  std::lock_guard lock(mutex_);
  // An older snapshot that no path is on is not asked for again.
  entries_.remove_if([&](const Entry& entry) {
    return entry.job == added.job && entry.snapshot.use_count() == 1;
  });
  entries_.push_front(std::move(added));
  int64_t bytes = 0;
  for (auto it = entries_.begin(); it != entries_.end();) {
    bytes += it->snapshot->bytes;
    it = bytes > max_bytes_ && it != entries_.begin() ? entries_.erase(it) : std::next(it);
  }
}

}  // namespace litags
