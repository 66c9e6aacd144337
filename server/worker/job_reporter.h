#ifndef LITAGS_SERVER_WORKER_JOB_REPORTER_H_
#define LITAGS_SERVER_WORKER_JOB_REPORTER_H_

#include <condition_variable>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "engine/core/cancel.h"
#include "engine/pipeline/report.h"
#include "server/worker/job_runner.h"
#include "server/worker/work_folder.h"

namespace litags {

// The thread beside a running engine that writes what the engine reports: numbers and pictures, and
// the files it leaves in its work folder. The engine's calls only leave a note, so that training
// never waits for a store; a lease is renewed by another thread (JobMonitor), so that it never
// waits for a large file.
class JobReporter : public ReconstructObserver {
 public:
  // All arguments must outlive this. `on_lease_lost` is called by the thread.
  JobReporter(const Lease& lease, const WorkerContext& context, const WorkerOptions& options,
              WorkFolder* folder, std::function<void()> on_lease_lost);
  ~JobReporter() override;

  void OnProgress(const Progress& progress) override;
  void OnSnapshot(const std::string& scene_path) override;
  void OnLine(std::string_view line) override;

  // The engine has ended: ends the thread, writes what is still to be written, and stores what the
  // folder holds now; stores that are away, and blobs that refuse the key, are waited for until
  // `stop` is raised. ABORTED (LEASE_LOST), and the errors of storing files: a log that cannot be
  // written costs no file.
  absl::Status Finish(const CancelToken& stop);

 private:
  void End();  // of the thread
  void Loop();
  void Write();  // what is due
  absl::Status WriteProgress();
  absl::Status WriteLog();
  // Adds a line to the log; empty: only what programs said. With the mutex held.
  void Log(std::string text);
  absl::Status KeepFiles();
  // Writes log and progress. The errors of a lease that is lost and of a store that is away or
  // refuses a picture; others are only noted.
  absl::Status WriteWords();
  void NoteFailure(const char* what, const absl::Status& status);

  const Lease& lease_;
  const WorkerContext& context_;
  const WorkerOptions& options_;
  WorkFolder* const folder_;
  const std::function<void()> on_lease_lost_;

  std::mutex mutex_;
  std::condition_variable wake_;
  bool finished_ = false;
  bool urgent_ = false;               // a report that does not wait for progress_seconds
  std::optional<Progress> progress_;  // newest, not written yet
  std::optional<int> snapshot_;       // iteration of the newest, not kept yet
  std::optional<Stage> last_stage_;
  std::string last_words_;     // of the message that was logged last
  std::vector<LogEntry> log_;  // not written yet
  std::string lines_;          // of programs; not written yet
  size_t line_bytes_ = 0;      // of all lines so far
  int iteration_ = 0;

  // Used by the thread, and by Finish() after it.
  bool lease_lost_ = false;
  bool must_keep_ = false;  // the folder's files are not all named in the row yet
  double last_progress_ = 0, last_log_ = 0, next_keep_ = 0;  // seconds

  std::thread thread_;
};

}  // namespace litags

#endif  // LITAGS_SERVER_WORKER_JOB_REPORTER_H_
