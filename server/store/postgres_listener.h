// Internal to server/store.
#ifndef LITAGS_SERVER_STORE_POSTGRES_LISTENER_H_
#define LITAGS_SERVER_STORE_POSTGRES_LISTENER_H_

#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <string>
#include <thread>

#include "absl/status/status.h"
#include "server/store/job_store.h"

namespace litags {

// A thread with a connection of its own that learns of changes: by LISTEN, and, since an
// announcement may be lost, or swallowed by a connection pooler, by comparing the database's
// snapshots every `look_every_seconds`. Equal snapshots see the same rows.
class PgListener {
 public:
  PgListener(std::string url, ChangeTopic topic, double look_every_seconds = 1);
  ~PgListener();

  // As JobStore::WaitForChange().
  int64_t Wait(int64_t seen, double seconds);

 private:
  void Loop();
  absl::Status Listen();  // until an error or the end
  void NoteChange();
  // Sleeps; true: the listener ends.
  bool Ends(double seconds);

  const std::string url_;
  const ChangeTopic topic_;
  const int64_t look_every_ms_;
  std::mutex mutex_;
  std::condition_variable changed_;
  int64_t changes_ = 0;
  bool ends_ = false;
  std::thread thread_;
};

}  // namespace litags

#endif  // LITAGS_SERVER_STORE_POSTGRES_LISTENER_H_
