#include "server/worker/job_reporter.h"

#include <spdlog/spdlog.h>

#include <cctype>
#include <chrono>
#include <cmath>
#include <iterator>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "engine/core/monotonic_seconds.h"
#include "server/store/file_error.h"
#include "server/worker/while_away.h"

namespace litags {
namespace {

constexpr double kPauseAfterFailure = 2;  // seconds
// Of what programs say in a run, and of one entry of the log that tells it.
constexpr size_t kMaxLineBytes = 256 << 10, kMaxEntryBytes = 8 << 10;

// "12 of 40" and "13 of 40" say the same twice.
std::string WithoutDigits(std::string text) {
  std::erase_if(text, [](unsigned char c) { return std::isdigit(c); });
  return text;
}

std::string LogText(const Progress& p) {
  std::string text(StageName(p.stage));
  if (!p.message.empty()) absl::StrAppend(&text, ": ", p.message);
  if (p.iteration == 0) return text;
  absl::StrAppend(&text, ": iteration ", p.iteration, " of ", p.iterations, ", loss ",
                  absl::SixDigits(p.loss), ", ", p.gaussians, " Gaussians");
  if (std::isfinite(p.psnr_holdout)) {
    absl::StrAppend(&text, ", held-out PSNR ", absl::SixDigits(p.psnr_holdout), " dB");
  }
  return text;
}

bool IsRefused(const absl::Status& status) { return HasReason(status, "BLOBS_DENIED"); }

// A key that expires is replaced, as a store that is away comes back.
bool IsAwayOrRefused(const absl::Status& status) { return IsAway(status) || IsRefused(status); }

}  // namespace

JobReporter::JobReporter(const Lease& lease, const WorkerContext& context,
                         const WorkerOptions& options, WorkFolder* folder,
                         std::function<void()> on_lease_lost)
    : lease_(lease),
      context_(context),
      options_(options),
      folder_(folder),
      on_lease_lost_(std::move(on_lease_lost)),
      thread_([this] { Loop(); }) {}

JobReporter::~JobReporter() { End(); }

void JobReporter::OnProgress(const Progress& progress) {
  std::lock_guard lock(mutex_);
  std::vector<uint8_t> preview;
  if (progress_) preview = std::move(progress_->preview_png);
  progress_ = progress;
  // A picture that was not written yet goes with the newer numbers.
  if (progress_->preview_png.empty()) progress_->preview_png = std::move(preview);
  iteration_ = progress.iteration;
  const std::string words = WithoutDigits(progress.message);
  if (last_stage_ != progress.stage || words != last_words_ || !progress.preview_png.empty()) {
    Log(LogText(progress));
    last_words_ = words;
  }
  if (last_stage_ != progress.stage || !progress_->preview_png.empty()) {
    last_stage_ = progress.stage;
    urgent_ = true;
    wake_.notify_one();
  }
}

void JobReporter::OnSnapshot(const std::string&) {
  std::lock_guard lock(mutex_);
  snapshot_ = iteration_;  // told just before
  urgent_ = true;
  wake_.notify_one();
}

void JobReporter::OnLine(std::string_view line) {
  std::lock_guard lock(mutex_);
  if (line_bytes_ >= kMaxLineBytes || line.empty()) return;
  line_bytes_ += line.size();
  if (lines_.size() + line.size() > kMaxEntryBytes) Log("");
  absl::StrAppend(&lines_, lines_.empty() ? "" : "\n", std::string(line.substr(0, kMaxEntryBytes)));
  if (line_bytes_ >= kMaxLineBytes) lines_ += "\n(what comes now is not kept)";
}

void JobReporter::Log(std::string text) {
  const int64_t now_ms = context_.store->NowMs();
  // In the order in which it was said.
  if (!lines_.empty()) {
    log_.push_back({0, now_ms, LogSeverity::kInfo, std::exchange(lines_, "")});
  }
  if (!text.empty()) log_.push_back({0, now_ms, LogSeverity::kInfo, std::move(text)});
}

void JobReporter::End() {
  {
    std::lock_guard lock(mutex_);
    finished_ = true;
    wake_.notify_one();
  }
  if (thread_.joinable()) thread_.join();
}

absl::Status JobReporter::Finish(const CancelToken& stop) {
  End();
  bool said = false;
  const auto write = [&]() -> absl::Status {
    urgent_ = true;  // at each try
    absl::Status status = WriteWords();
    if (status.ok()) status = KeepFiles();
    if (IsRefused(status) && !std::exchange(said, true)) {
      std::lock_guard lock(mutex_);
      Log("waiting: the blob store refuses the worker's key");
    }
    return status;
  };
  const absl::Status status = lease_lost_ ? absl::AbortedError("the lease is lost")
                                          : WhileAway(stop, write, IsAwayOrRefused);
  if (absl::IsAborted(status)) NoteFailure("", status);
  return status;
}

void JobReporter::Loop() {
  for (;;) {
    {
      std::unique_lock lock(mutex_);
      wake_.wait_for(lock, std::chrono::duration<double>(options_.poll_seconds),
                     [this] { return finished_ || urgent_; });
      if (finished_) return;
    }
    Write();
    if (lease_lost_) return;
  }
}

void JobReporter::Write() {
  if (const absl::Status status = WriteProgress(); !status.ok()) {
    NoteFailure("write its progress", status);
  }
  if (lease_lost_) return;
  if (const absl::Status status = WriteLog(); !status.ok()) NoteFailure("write its log", status);
  if (lease_lost_ || MonotonicSeconds() < next_keep_) return;
  const int64_t stored = folder_->stored_bytes();
  const absl::Status status = KeepFiles();
  double pause = folder_->stored_bytes() == stored ? 0 : options_.keep_seconds;
  if (!status.ok()) {
    NoteFailure("keep its files", status);
    pause = kPauseAfterFailure;
  }
  next_keep_ = MonotonicSeconds() + pause;
}

absl::Status JobReporter::WriteWords() {
  const absl::Status log = WriteLog();
  if (absl::IsAborted(log) || IsAway(log)) return log;
  if (!log.ok()) NoteFailure("write its log", log);
  const absl::Status progress = WriteProgress();
  if (absl::IsAborted(progress) || IsAwayOrRefused(progress)) return progress;
  if (!progress.ok()) NoteFailure("write its progress", progress);
  return absl::OkStatus();
}

absl::Status JobReporter::WriteProgress() {
  std::optional<Progress> progress;
  {
    std::lock_guard lock(mutex_);
    if (urgent_ || MonotonicSeconds() - last_progress_ >= options_.progress_seconds) {
      progress.swap(progress_);
    }
    urgent_ = false;
  }
  if (!progress) return absl::OkStatus();
  last_progress_ = MonotonicSeconds();
  const absl::Status status = context_.leases->AddProgress(lease_, *progress);
  if (status.ok()) return status;
  // The store may come back: what nothing newer has replaced by then is written with the next.
  std::lock_guard lock(mutex_);
  if (!progress_) {
    progress_.swap(progress);
  } else if (progress_->preview_png.empty()) {
    progress_->preview_png = std::move(progress->preview_png);
  }
  return status;
}

absl::Status JobReporter::WriteLog() {
  std::vector<LogEntry> entries;
  {
    std::lock_guard lock(mutex_);
    if (!finished_ && MonotonicSeconds() - last_log_ < options_.progress_seconds)
      return absl::OkStatus();
    Log("");
    entries.swap(log_);
  }
  if (entries.empty()) return absl::OkStatus();
  last_log_ = MonotonicSeconds();
  const absl::Status status = context_.leases->AddLog(lease_, entries);
  if (status.ok()) return status;
  std::lock_guard lock(mutex_);
  log_.insert(log_.begin(), std::make_move_iterator(entries.begin()),
              std::make_move_iterator(entries.end()));
  return status;
}

absl::Status JobReporter::KeepFiles() {
  std::optional<int> snapshot;
  bool finished = false;
  {
    std::lock_guard lock(mutex_);
    snapshot.swap(snapshot_);
    finished = finished_;
  }
  const absl::Status status = [&]() -> absl::Status {
    // A scene that was not announced yet will be in a moment.
    std::vector<std::string> but;
    if (!snapshot && !finished) but = {kSceneFile};
    LITAGS_ASSIGN_OR_RETURN(const bool changed, folder_->Store(but));
    must_keep_ = must_keep_ || changed || snapshot.has_value();
    if (!must_keep_) return absl::OkStatus();
    LITAGS_RETURN_IF_ERROR(context_.leases->Keep(lease_, folder_->kept(), snapshot));
    must_keep_ = false;
    folder_->RemoveReplaced();
    return absl::OkStatus();
  }();
  if (status.ok()) return status;
  std::lock_guard lock(mutex_);
  if (!snapshot_) snapshot_.swap(snapshot);
  return status;
}

void JobReporter::NoteFailure(const char* what, const absl::Status& status) {
  if (!absl::IsAborted(status)) {
    spdlog::warn("job={} cannot {}: {}", lease_.job.id, what, MessageWithReason(status));
    return;
  }
  lease_lost_ = true;
  context_.leases->NoteUnreferencedBlobs(lease_)
      .IgnoreError();  // found at the latest with the job's deletion
  on_lease_lost_();
}

}  // namespace litags
