#include "server/jobs/jobs.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <set>
#include <string>
#include <tuple>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "server/jobs/codec.h"
#include "server/jobs/start_checks.h"
#include "server/jobs/transition.h"
#include "server/store/digest.h"

namespace litags {
namespace {

// A job whose last events, so many, are all changes of its state is not queued again.
constexpr int kEventsWithoutProgress = 1000;

absl::StatusOr<ReconstructOptions> OptionsOf(const JobRecord& job) {
  if (job.options.empty()) return ReconstructOptions();
  return Decode<ReconstructOptions>(job.options);
}

// The caps may be others than when the job was made. Its priority is not checked: whoever set it
// could, an administrator too, and this call leaves it. Nor is its run time, which is cut instead.
absl::Status ApplyCaps(const JobCaps& caps, const ReconstructOptions& options, JobRecord* job) {
  LITAGS_ASSIGN_OR_RETURN(JobPolicy policy, PolicyOf(*job));
  caps.LimitRunTime(&policy);
  JobPolicy checked = policy;
  checked.priority = std::min(policy.priority, caps.max_priority);
  LITAGS_RETURN_IF_ERROR(caps.Check(options, checked));
  job->policy = Encode(policy);
  return absl::OkStatus();
}

// The call that queued the job last, once more: its answer was lost.
bool IsRepeated(const JobRecord& job, const std::string& request_id) {
  return !request_id.empty() && job.start_request_id == request_id;
}

// That there is nobody who will ever run the job is known now only where workers are there.
absl::Status CheckNetwork(const JobRecord& job, const Workforce& workers) {
  if (job.needs.empty()) return absl::OkStatus();
  LITAGS_ASSIGN_OR_RETURN(const auto needs, Decode<Resources>(job.needs));
  if (!HasDepthNetwork(needs)) return absl::OkStatus();
  const bool none = std::none_of(workers.begin(), workers.end(), HasDepthNetwork);
  if (workers.empty() || !none) return absl::OkStatus();
  return MakeError(absl::StatusCode::kFailedPrecondition, "DEPTH_MODEL_MISSING",
                   "options.depth_source",
                   "options.depth_source: a network was asked for, and no worker of this service "
                   "has one; make a job with another source, or ask the operator for "
                   "--depth-model");
}

}  // namespace

std::string EtagOf(const JobRecord& job) {
  return Sha256::Hex(absl::StrCat(static_cast<int>(job.state), "\n", job.display_name, "\n",
                                  job.labels, "\n", job.policy))
      .substr(0, 16);
}

std::shared_ptr<Jobs> Jobs::For(ClientView view) const {
  struct Owned {
    ClientJobStore store;
    Jobs jobs;
    Owned(const Jobs& all, const ClientView& view)
        : store(all.store_, view),
          jobs(&store, all.blobs_, all.data_, all.clock_, all.uploads_.area(), view,
               all.webhooks_) {}
  };
  auto owned = std::make_shared<Owned>(*this, view);
  return {owned, &owned->jobs};
}

absl::StatusOr<std::optional<JobRecord>> Jobs::MadeBy(const std::string& request_id,
                                                      const std::string& request_digest) {
  if (request_id.empty() || request_digest.empty()) return std::nullopt;
  LITAGS_ASSIGN_OR_RETURN(auto job, store_->FindRequest(view_.owner, request_id));
  if (job && job->request_digest != request_digest) return std::nullopt;
  return job;
}

absl::StatusOr<JobRecord> Jobs::Create(const NewJob& wanted) {
  // Before the checks: the operator may have lowered a cap since.
  LITAGS_ASSIGN_OR_RETURN(const auto before, MadeBy(wanted.request_id, wanted.request_digest));
  if (before) return *before;
  LITAGS_RETURN_IF_ERROR(CheckLabels(wanted.labels));
  LITAGS_RETURN_IF_ERROR(CheckWebhook(wanted.webhook, webhooks_));
  LITAGS_RETURN_IF_ERROR(view_.caps.Check(wanted.options, wanted.policy));
  const int64_t now_ms = clock_();
  JobRecord job;
  job.id = RandomHex(8);
  job.request_id = wanted.request_id;
  job.request_digest = wanted.request_digest;
  job.display_name = wanted.display_name;
  job.labels = Encode(wanted.labels);
  job.webhook = Encode(wanted.webhook);
  job.content_digest = wanted.content_digest;
  job.clone_source = wanted.clone_source;
  job.options = Encode(wanted.options);
  job.policy = Encode(wanted.policy);
  job.priority = wanted.policy.priority;
  job.needs = EncodedNeedsOf(wanted.policy, wanted.options);
  job.create_time_ms = now_ms;
  job.expire_time_ms = uploads_.Expiry();
  LITAGS_ASSIGN_OR_RETURN(JobRecord made, store_->Create(job, [&](JobTransaction& transaction) {
    return AddStateEvent(transaction, now_ms, "created");
  }));
  // ResumeJob changes options, and later versions have more of them: neither makes it another
  // request. Of older jobs only what they are now is known.
  const bool known = !made.request_digest.empty() && !job.request_digest.empty();
  if (known && made.request_digest == job.request_digest) return made;
  JobPolicy started = wanted.policy;  // as Start() has it
  view_.caps.LimitRunTime(&started);
  const bool same_policy = made.policy == job.policy || made.policy == Encode(started);
  const char* other = made.display_name != job.display_name       ? "another title"
                      : made.options != job.options               ? "other options"
                      : !same_policy                              ? "another policy"
                      : made.content_digest != job.content_digest ? "other files"
                      : known                                     ? "another request"
                                                                  : nullptr;
  if (!other) return made;
  return MakeError(absl::StatusCode::kAlreadyExists, "REQUEST_ID_REUSED", "request_id",
                   absl::StrCat("request_id \"", job.request_id, "\" made jobs/", made.id, " with ",
                                other, "; use a new one"));
}

absl::StatusOr<JobRecord> Jobs::Clone(std::string_view id, const NewJob& asked,
                                      const CancelToken& cancel) {
  LITAGS_ASSIGN_OR_RETURN(const JobRecord source, store_->Get(id));
  if (source.owner != view_.owner) {
    return MakeError(absl::StatusCode::kPermissionDenied, "NOT_YOUR_JOB", "name",
                     absl::StrCat("jobs/", source.id, " is the client \"", source.owner,
                                  "\"'s; only that client can clone it"));
  }
  LITAGS_ASSIGN_OR_RETURN(std::vector<FileRecord> files, store_->Files(id));
  // Archives last: one that is noted does not come again for a file that is gone.
  std::stable_partition(files.begin(), files.end(),
                        [](const FileRecord& f) { return f.role != FileRole::kArchive; });
  NewJob wanted = asked;
  wanted.clone_source = source.id;
  LITAGS_ASSIGN_OR_RETURN(const JobPolicy policy, PolicyOf(source));
  // An administrator may have raised it.
  if (wanted.policy.priority == policy.priority) {
    wanted.policy.priority = std::min(policy.priority, view_.caps.max_priority);
  }
  // The operator may have lowered the cap.
  if (wanted.policy.max_run_seconds == policy.max_run_seconds && view_.caps.max_run_seconds > 0) {
    wanted.policy.max_run_seconds = std::min(policy.max_run_seconds, view_.caps.max_run_seconds);
  }
  LITAGS_ASSIGN_OR_RETURN(const JobRecord clone, Create(wanted));
  // Of a call that was repeated. Once the clone has had all files, they are its client's to change.
  if (clone.state != JobState::kUploading || clone.clone_source.empty()) return clone;
  const auto key = [](const FileRecord& f) { return std::tuple(f.role, f.name, f.sha256); };
  LITAGS_ASSIGN_OR_RETURN(const std::vector<FileRecord> cloned, store_->Files(clone.id));
  std::set<std::tuple<FileRole, std::string, std::string>> there;
  for (const FileRecord& file : cloned) there.insert(key(file));
  std::erase_if(files, [&](const FileRecord& file) { return there.contains(key(file)); });
  LITAGS_RETURN_IF_ERROR(uploads_.AdoptFrom(source.id, clone.id, files, cancel));
  return store_->Update(clone.id, [](JobTransaction& transaction) {
    transaction.job.clone_source.clear();
    return absl::OkStatus();
  });
}

absl::StatusOr<std::optional<KeptFile>> Jobs::SceneOf(const JobRecord& job) {
  if (job.kept.empty()) return std::nullopt;
  LITAGS_ASSIGN_OR_RETURN(const KeptFiles kept, Decode<KeptFiles>(job.kept));
  const auto scene = kept.find(kSceneFile);
  if (scene == kept.end()) return std::nullopt;
  return scene->second;
}

absl::Status Jobs::CheckProgress(std::string_view id, const std::string& request_id) {
  LITAGS_ASSIGN_OR_RETURN(const JobRecord job, store_->Get(id));
  if (job.last_event < kEventsWithoutProgress || IsRepeated(job, request_id)) {
    return absl::OkStatus();
  }
  LITAGS_ASSIGN_OR_RETURN(
      const std::vector<EventRecord> events,
      store_->Events(id, job.last_event - kEventsWithoutProgress, kEventsWithoutProgress));
  const auto is_progress = [](const EventRecord& event) { return event.kind != EventKind::kState; };
  if (std::any_of(events.begin(), events.end(), is_progress)) return absl::OkStatus();
  return MakeError(absl::StatusCode::kFailedPrecondition, "JOB_WITHOUT_PROGRESS", "name",
                   absl::StrCat("jobs/", job.id, " was queued again and again: none of its last ",
                                kEventsWithoutProgress,
                                " events is of any progress; make a new one with CloneJob"));
}

absl::Status Jobs::Enqueue(JobTransaction& job, JobAction action, std::string_view message) {
  LITAGS_RETURN_IF_ERROR(NextState(job.job.state, action).status());
  LITAGS_ASSIGN_OR_RETURN(const std::vector<FileRecord> files, job.Files());
  LITAGS_ASSIGN_OR_RETURN(const ReconstructOptions options, OptionsOf(job.job));
  LITAGS_RETURN_IF_ERROR(ApplyCaps(view_.caps, options, &job.job));
  LITAGS_ASSIGN_OR_RETURN(const JobPolicy policy, PolicyOf(job.job));
  LITAGS_ASSIGN_OR_RETURN(const int64_t least, CheckFiles(files, options, policy.max_memory_bytes));
  job.job.needs = EncodedNeedsOf(policy, options, least);
  job.job.attempt = 0;
  job.job.run_ms = 0;
  return ApplyAction(job, action, clock_(), message);
}

absl::StatusOr<JobRecord> Jobs::Start(std::string_view id, const std::string& request_id) {
  LITAGS_RETURN_IF_ERROR(CheckProgress(id, request_id));
  LITAGS_ASSIGN_OR_RETURN(const Workforce workers, Workers());
  bool repeated = false;
  auto job = store_->Update(id, [&](JobTransaction& transaction) -> absl::Status {
    repeated = IsRepeated(transaction.job, request_id);
    if (repeated) return absl::OkStatus();
    LITAGS_RETURN_IF_ERROR(NextState(transaction.job.state, JobAction::kStart).status());
    LITAGS_RETURN_IF_ERROR(CheckNetwork(transaction.job, workers));
    transaction.job.start_request_id = request_id;
    return Enqueue(transaction, JobAction::kStart, "started");
  });
  // What had come of files that are not there: nobody can complete them now. A sweep removes the
  // rest, so that nobody waits for the blob store.
  if (job.ok() && !repeated) uploads_.partials().RemoveJob(id).IgnoreError();
  return job;
}

absl::StatusOr<JobRecord> Jobs::Resume(std::string_view id, const ResumeChange& change,
                                       const std::string& request_id) {
  LITAGS_RETURN_IF_ERROR(CheckProgress(id, request_id));
  LITAGS_ASSIGN_OR_RETURN(const Workforce workers, Workers());
  return store_->Update(id, [&](JobTransaction& job) -> absl::Status {
    if (IsRepeated(job.job, request_id)) return absl::OkStatus();
    // Before what the change asks for, which is of no use then.
    const JobAction action = change ? JobAction::kExtend : JobAction::kResume;
    LITAGS_RETURN_IF_ERROR(NextState(job.job.state, action).status());
    LITAGS_RETURN_IF_ERROR(CheckNetwork(job.job, workers));
    job.job.start_request_id = request_id;
    if (!change) return Enqueue(job, JobAction::kResume, "resumed");
    LITAGS_ASSIGN_OR_RETURN(const ReconstructOptions before, OptionsOf(job.job));
    LITAGS_ASSIGN_OR_RETURN(JobPolicy policy, PolicyOf(job.job));
    const double run_seconds = policy.max_run_seconds;
    ReconstructOptions options = before;
    LITAGS_RETURN_IF_ERROR(change(options, policy));
    LITAGS_ASSIGN_OR_RETURN(options, ResumedOptions(before, options));
    if (policy.priority != job.job.priority) {
      LITAGS_RETURN_IF_ERROR(view_.caps.CheckPriority(policy.priority));
    }
    if (policy.max_run_seconds != run_seconds) {
      LITAGS_RETURN_IF_ERROR(view_.caps.CheckRunTime(policy.max_run_seconds));
    }
    job.job.options = Encode(options);
    job.job.policy = Encode(policy);
    job.job.priority = policy.priority;
    const int more = options.iterations - before.iterations;
    if (more == 0) return Enqueue(job, JobAction::kResume, "resumed");
    return Enqueue(job, JobAction::kExtend,
                   absl::StrCat("resumed, for ", more, " more iterations"));
  });
}

absl::StatusOr<JobRecord> Jobs::Update(std::string_view id, std::string_view etag,
                                       DetailsChange change) {
  return store_->Update(id, [&](JobTransaction& transaction) -> absl::Status {
    JobRecord& job = transaction.job;
    const std::string before = EtagOf(job);
    LITAGS_ASSIGN_OR_RETURN(JobPolicy policy, PolicyOf(job));
    JobDetails details{
        job.display_name, {}, policy.priority, policy.retention_seconds, policy.worker_labels};
    LITAGS_ASSIGN_OR_RETURN(details.labels, LabelsOf(job));
    LITAGS_RETURN_IF_ERROR(change(details));
    LITAGS_RETURN_IF_ERROR(CheckLabels(details.labels));
    if (details.priority != policy.priority) {
      LITAGS_RETURN_IF_ERROR(view_.caps.CheckPriority(details.priority));
    }
    policy.priority = details.priority;
    policy.retention_seconds = details.retention_seconds;
    if (details.worker_labels != policy.worker_labels) {
      policy.worker_labels = details.worker_labels;
      LITAGS_ASSIGN_OR_RETURN(const ReconstructOptions options, OptionsOf(job));
      LITAGS_ASSIGN_OR_RETURN(job.needs, NeedsWithLabelsOf(policy, options, job.needs));
    }
    LITAGS_RETURN_IF_ERROR(policy.Validate());
    job.display_name = details.display_name;
    job.labels = Encode(details.labels);
    job.policy = Encode(policy);
    job.priority = policy.priority;
    // The call may be the second of one whose answer was lost.
    if (!etag.empty() && etag != before && EtagOf(job) != before) {
      return MakeError(absl::StatusCode::kAborted, "ETAG_MISMATCH", "etag",
                       absl::StrCat("jobs/", job.id,
                                    " was changed since it was read; read it "
                                    "again, and change that"));
    }
    if (!IsTerminal(job.state)) return absl::OkStatus();
    LITAGS_ASSIGN_OR_RETURN(job.expire_time_ms, ExpiryOf(job, job.state, job.end_time_ms));
    return absl::OkStatus();
  });
}

absl::StatusOr<JobRecord> Jobs::Cancel(std::string_view id) {
  auto job = store_->Update(id, [&](JobTransaction& transaction) {
    // A running job only learns of the wish; its worker takes it to CANCELLED.
    transaction.job.cancel_requested = transaction.job.state == JobState::kRunning;
    transaction.job.has_unreferenced_blobs = true;  // files that were replaced
    return ApplyAction(transaction, JobAction::kCancel, clock_(), "cancelled on request");
  });
  if (job.ok()) uploads_.partials().RemoveJob(id).IgnoreError();  // a sweep removes the rest
  return job;
}

absl::Status Jobs::Delete(std::string_view id) {
  const auto change = [](JobTransaction& job) -> absl::Status {
    LITAGS_RETURN_IF_ERROR(NextState(job.job.state, JobAction::kRemove).status());
    return job.Remove();
  };
  LITAGS_RETURN_IF_ERROR(store_->Update(id, change).status());
  // The job is gone, whatever its files do.
  if (const absl::Status status = uploads_.RemoveAllOf(id); !status.ok()) {
    spdlog::warn("job={} was deleted; its files are removed later: {}", id,
                 std::string(status.message()));
  }
  return absl::OkStatus();
}

}  // namespace litags
