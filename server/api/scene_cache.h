#ifndef LITAGS_SERVER_API_SCENE_CACHE_H_
#define LITAGS_SERVER_API_SCENE_CACHE_H_

#include <cstdint>
#include <list>
#include <memory>
#include <mutex>
#include <string>

#include "absl/status/statusor.h"
#include "engine/pipeline/engine.h"
#include "server/jobs/jobs.h"

namespace litags {

// Scenes of jobs in memory, the ones used last, up to `max_bytes` of what their files have; one is
// kept whatever its size. A file is on this machine's disk only while it is loaded, one at a time.
// Thread-safe.
class SceneCache {
 public:
  // `engine` must outlive this.
  SceneCache(Engine* engine, int64_t max_bytes) : engine_(engine), max_bytes_(max_bytes) {}

  // The newest snapshot of the job called `name`, if it is one of `jobs`. FAILED_PRECONDITION
  // (SCENE_NOT_READY) if there is none yet; else the errors of ParseJobName(), Jobs::Get(),
  // Jobs::FetchKept() and Engine::LoadScene().
  absl::StatusOr<std::shared_ptr<const Scene>> Get(Jobs* jobs, const std::string& name);

 private:
  struct Entry {
    std::string job;
    KeptFile file;
    std::shared_ptr<const Scene> scene;
  };

  absl::StatusOr<std::shared_ptr<const Scene>> Load(Jobs* jobs, const std::string& job,
                                                    const KeptFile& file);
  std::shared_ptr<const Scene> Find(const std::string& job, const KeptFile& file);
  void Add(Entry entry);

  Engine* const engine_;
  const int64_t max_bytes_;
  std::mutex load_mutex_;  // one scene is loaded at a time, and only once
  std::mutex mutex_;
  std::list<Entry> entries_;  // used last in front
};

}  // namespace litags

#endif  // LITAGS_SERVER_API_SCENE_CACHE_H_
