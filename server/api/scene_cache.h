#ifndef LITAGS_SERVER_API_SCENE_CACHE_H_
#define LITAGS_SERVER_API_SCENE_CACHE_H_

#include <cstdint>
#include <list>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "engine/pipeline/engine.h"
#include "server/jobs/jobs.h"

namespace litags {

// Scenes of jobs in memory, the ones used last, up to `max_bytes` of what their files have; one is
// kept whatever its size. Of one job there are the newest snapshot and those that paths are on. A
// file is on this machine's disk only while it is loaded, one at a time. Thread-safe.
class SceneCache {
 public:
  // What a path is on, from frame to frame. It keeps no scene in memory, or clients that read
  // slowly would keep every snapshot that a job ever had.
  using Snapshot = std::shared_ptr<const KeptFile>;

  // `engine` must outlive this.
  SceneCache(Engine* engine, int64_t max_bytes) : engine_(engine), max_bytes_(max_bytes) {}

  // The newest snapshot of the job called `name`, if it is one of `jobs`. FAILED_PRECONDITION
  // (SCENE_NOT_READY) if there is none yet; else the errors of ParseJobName(), Jobs::Get(),
  // Jobs::FetchKept() and Engine::LoadScene().
  absl::StatusOr<std::shared_ptr<const Scene>> Get(Jobs* jobs, const std::string& name);
  // The one that `snapshot` names, if it is still in memory; else, and where it names none, the
  // newest, which it then names.
  absl::StatusOr<std::shared_ptr<const Scene>> Get(Jobs* jobs, const std::string& name,
                                                   Snapshot* snapshot);

 private:
  struct Entry {
    std::string job;
    Snapshot snapshot;
    std::shared_ptr<const Scene> scene;
  };

  // The newest.
  absl::StatusOr<Entry> Newest(Jobs* jobs, const std::string& id);
  absl::StatusOr<std::shared_ptr<const Scene>> Load(Jobs* jobs, const std::string& job,
                                                    const KeptFile& file);
  std::optional<Entry> Find(const std::string& job, const KeptFile& file);
  void Add(Entry entry);

  Engine* const engine_;
  const int64_t max_bytes_;
  std::mutex load_mutex_;  // one scene is loaded at a time, and only once
  std::mutex mutex_;
  std::list<Entry> entries_;  // used last in front
};

}  // namespace litags

#endif  // LITAGS_SERVER_API_SCENE_CACHE_H_
