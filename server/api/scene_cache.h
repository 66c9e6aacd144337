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

// Loaded scenes of jobs, the ones used last; a snapshot that was replaced is loaded anew.
// Thread-safe.
class SceneCache {
 public:
  // `engine` must outlive this.
  explicit SceneCache(Engine* engine, size_t capacity = 4) : engine_(engine), capacity_(capacity) {}

  // The newest snapshot of the job called `name`, if it is one of `jobs`. FAILED_PRECONDITION
  // (SCENE_NOT_READY) if there is none yet; else the errors of ParseJobName(), Jobs::Get() and
  // Engine::LoadScene().
  absl::StatusOr<std::shared_ptr<const Scene>> Get(Jobs* jobs, const std::string& name);

 private:
  struct Entry {
    std::string path;
    int64_t stamp;  // tells versions of the file apart
    std::shared_ptr<const Scene> scene;
  };

  std::shared_ptr<const Scene> Find(const std::string& path, int64_t stamp);

  Engine* const engine_;
  const size_t capacity_;
  std::mutex load_mutex_;  // one scene is loaded at a time, and only once
  std::mutex mutex_;
  std::list<Entry> entries_;  // used last in front
};

}  // namespace litags

#endif  // LITAGS_SERVER_API_SCENE_CACHE_H_
