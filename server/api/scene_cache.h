#ifndef LITAGS_SERVER_API_SCENE_CACHE_H_
#define LITAGS_SERVER_API_SCENE_CACHE_H_

#include <cstdint>
#include <functional>
#include <list>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "engine/pipeline/engine.h"
#include "server/api/gate.h"
#include "server/api/thread_pool.h"
#include "server/jobs/jobs.h"
#include "server/jobs/kept_files.h"

namespace litags {

// Scenes of jobs in memory, the ones used last, up to `max_bytes` of what their files have; one is
// kept whatever its size. Of one job there are the newest snapshot and those that paths are on. A
// file is on this machine's disk only while it is loaded, one at a time, by a thread of its own: a
// blob store that is away holds up nobody whose scene is in memory. Thread-safe.
class SceneCache {
 public:
  using Result = absl::StatusOr<std::shared_ptr<const Scene>>;
  // What a path is on, from frame to frame. It keeps no scene in memory, or clients that read
  // slowly would keep every snapshot that a job ever had.
  using Snapshot = std::shared_ptr<const KeptFile>;

  // Both must outlive this: `loads` has one thread, and refuses calls of a client that has too many
  // waiting.
  SceneCache(Engine* engine, int64_t max_bytes, ThreadPool* loads)
      : engine_(engine), max_bytes_(max_bytes), loads_(loads) {}

  // The scene of the job called `name`, if it is one of the call's: the snapshot that `snapshot`
  // names, if it is still in memory; else, and where it names none, the newest, which it then
  // names. nullopt: it is not in memory, and `then` is called with it from that thread; until then,
  // call, token and `snapshot` must live. FAILED_PRECONDITION if there is none: SCENE_NOT_READY,
  // or, of a job that has ended, SCENE_NOT_MADE; else the errors of ParseJobName(), Jobs::Get(),
  // Jobs::FetchKept() and Engine::LoadScene(), and what `loads` refuses with.
  std::optional<Result> Get(Call& call, const CancelToken& cancel, const std::string& name,
                            Snapshot* snapshot, std::function<void(const Result&)> then);

 private:
  struct Entry {
    std::string job;
    Snapshot snapshot;
    std::shared_ptr<const Scene> scene;
  };
  // Of a load that failed, and how many had been asked for then.
  struct Failure {
    int64_t asked;
    absl::Status status;
  };

  absl::StatusOr<KeptFile> NewestOf(Jobs* jobs, const std::string& id);
  // By the thread of loads. `asked`: how many loads were asked for when this one was.
  absl::StatusOr<Entry> LoadNewest(Jobs* jobs, const std::string& id, int64_t asked);
  absl::StatusOr<std::shared_ptr<const Scene>> Load(Jobs* jobs, const std::string& job,
                                                    const KeptFile& file);
  std::optional<Entry> Find(const std::string& job, const KeptFile& file);
  void Add(Entry entry);

  Engine* const engine_;
  const int64_t max_bytes_;
  ThreadPool* const loads_;
  std::mutex mutex_;
  std::list<Entry> entries_;  // used last in front
  int64_t asked_ = 0, ended_ = 0;
  std::map<std::string, Failure> failures_;  // by job, while others wait
};

}  // namespace litags

#endif  // LITAGS_SERVER_API_SCENE_CACHE_H_
