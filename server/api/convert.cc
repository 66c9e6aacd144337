#include "server/api/convert.h"

#include <google/protobuf/descriptor.h>
#include <google/protobuf/util/json_util.h>
#include <google/protobuf/util/time_util.h>

#include <cmath>
#include <type_traits>

#include "absl/strings/str_cat.h"
#include "engine/core/check.h"
#include "engine/core/error.h"
#include "litags/v1/reconstruction_service.pb.h"
#include "server/errors/scrub.h"
#include "server/jobs/codec.h"
#include "server/jobs/jobs.h"

namespace litags {
namespace {

using google::protobuf::util::TimeUtil;

static_assert(static_cast<int>(Stage::kLoading) + 1 == v1::STAGE_LOADING);
static_assert(static_cast<int>(Stage::kSaving) + 1 == v1::STAGE_SAVING);
static_assert(static_cast<int>(JobState::kUploading) == v1::JOB_STATE_UPLOADING);
static_assert(static_cast<int>(JobState::kCancelled) == v1::JOB_STATE_CANCELLED);
static_assert(static_cast<int>(LogSeverity::kError) == v1::LOG_SEVERITY_ERROR);
static_assert(static_cast<int>(FileRole::kPhoto) == v1::FILE_ROLE_PHOTO);
static_assert(static_cast<int>(FileRole::kArchive) == v1::FILE_ROLE_ARCHIVE);
static_assert(static_cast<int>(FileRole::kMask) == v1::FILE_ROLE_MASK);
static_assert(static_cast<int>(FileRole::kVideo) == v1::FILE_ROLE_VIDEO);

using google::protobuf::FieldDescriptor;
using google::protobuf::Reflection;

// Of a report: a Job must fit into a message (gRPC's clients take 4 MiB) and many into a page.
constexpr int kMaxNames = 1000;

// The field of JobOptions that the engine's field is, by name.
const FieldDescriptor* ProtoField(const char* name) {
  const FieldDescriptor* field = v1::JobOptions::descriptor()->FindFieldByName(name);
  LITAGS_CHECK(field != nullptr);
  return field;
}

// Enums of the proto have the engine's values plus 1; 0 is unspecified: the default.
template <class T>
absl::Status ReadField(const v1::JobOptions& proto, const char* name, T* value) {
  const FieldDescriptor* field = ProtoField(name);
  const Reflection& reflection = *proto.GetReflection();
  if (!reflection.HasField(proto, field)) return absl::OkStatus();
  if constexpr (IsOptional<T>::value) {
    if (reflection.GetEnumValue(proto, field) == 0) {
      value->reset();
      return absl::OkStatus();
    }
    typename T::value_type known{};
    LITAGS_RETURN_IF_ERROR(ReadField(proto, name, &known));
    *value = known;
  } else if constexpr (std::is_enum_v<T>) {
    int number = reflection.GetEnumValue(proto, field);
    if (field->enum_type()->FindValueByNumber(number) == nullptr) {
      return InvalidInput("OPTION_OUT_OF_RANGE", absl::StrCat("options.", name),
                          absl::StrCat("options.", name, " has the value ", number,
                                       ", which this server does not know; see job.proto"));
    }
    if (number == 0) number = reflection.GetEnumValue(OptionsToProto({}), field);
    *value = static_cast<T>(number - 1);
  } else if constexpr (std::is_same_v<T, bool>) {
    *value = reflection.GetBool(proto, field);
  } else if constexpr (std::is_same_v<T, double>) {
    *value = reflection.GetDouble(proto, field);
  } else if constexpr (std::is_same_v<T, uint64_t>) {
    *value = reflection.GetUInt64(proto, field);
  } else if constexpr (std::is_same_v<T, int64_t>) {
    *value = reflection.GetInt64(proto, field);
  } else {
    *value = reflection.GetInt32(proto, field);
  }
  return absl::OkStatus();
}

template <class T>
void WriteField(const char* name, const T& value, v1::JobOptions* proto) {
  const FieldDescriptor* field = ProtoField(name);
  const Reflection& reflection = *proto->GetReflection();
  if constexpr (IsOptional<T>::value) {
    if (value.has_value()) WriteField(name, *value, proto);
  } else if constexpr (std::is_enum_v<T>) {
    reflection.SetEnumValue(proto, field, static_cast<int>(value) + 1);
  } else if constexpr (std::is_same_v<T, bool>) {
    reflection.SetBool(proto, field, value);
  } else if constexpr (std::is_same_v<T, double>) {
    reflection.SetDouble(proto, field, value);
  } else if constexpr (std::is_same_v<T, uint64_t>) {
    reflection.SetUInt64(proto, field, value);
  } else if constexpr (std::is_same_v<T, int64_t>) {
    reflection.SetInt64(proto, field, value);
  } else {
    reflection.SetInt32(proto, field, value);
  }
}

v1::Stage StageToProto(Stage stage) { return static_cast<v1::Stage>(static_cast<int>(stage) + 1); }

void ProgressToProto(const Progress& progress, v1::Progress* proto) {
  proto->set_stage(StageToProto(progress.stage));
  proto->set_message(progress.message);
  proto->set_iteration(progress.iteration);
  proto->set_iterations(progress.iterations);
  proto->set_loss(progress.loss);
  proto->set_loss_exposure(progress.loss_exposure);
  proto->set_loss_reconstruction(progress.loss_reconstruction);
  proto->set_loss_structure(progress.loss_structure);
  proto->set_loss_denoise(progress.loss_denoise);
  if (std::isfinite(progress.psnr_holdout)) proto->set_psnr_holdout(progress.psnr_holdout);
  proto->set_gaussians(progress.gaussians);
  proto->set_iterations_per_second(progress.iterations_per_second);
  if (progress.eta_seconds > 0) *proto->mutable_eta() = DurationToProto(progress.eta_seconds);
}

void ReportToProto(const ReconstructReport& report, v1::JobReport* proto) {
  proto->set_photos(report.photos);
  proto->set_registered(report.registered);
  for (const std::string& name : report.dropped) {
    if (proto->dropped_size() < kMaxNames) proto->add_dropped(name);
  }
  proto->set_sfm_preparation(report.sfm_preparation);
  proto->set_sparse_points(report.sparse_points);
  proto->set_gaussians(report.gaussians);
  proto->set_iterations(report.iterations);
  *proto->mutable_run_time() = DurationToProto(report.seconds);
  if (std::isfinite(report.psnr_holdout)) proto->set_psnr_holdout(report.psnr_holdout);
  if (std::isfinite(report.ssim_holdout)) proto->set_ssim_holdout(report.ssim_holdout);
  proto->set_depth_used(report.depth_used);
  for (const std::string& note : report.notes) {
    if (proto->notes_size() < kMaxNames) proto->add_notes(WithoutPaths(note));
  }
}

v1::JobPolicy PolicyToProto(const JobPolicy& policy) {
  v1::JobPolicy proto;
  proto.set_priority(policy.priority);
  *proto.mutable_max_run_time() = DurationToProto(policy.max_run_seconds);
  proto.set_max_memory_bytes(policy.max_memory_bytes);
  *proto.mutable_retention() = DurationToProto(policy.retention_seconds);
  proto.set_min_cores(policy.min_cores);
  proto.set_min_memory_bytes(policy.min_memory_bytes);
  proto.mutable_worker_labels()->Add(policy.worker_labels.begin(), policy.worker_labels.end());
  return proto;
}

v1::Webhook WebhookToProto(const Webhook& webhook) {
  v1::Webhook proto;
  proto.set_url(webhook.url);
  proto.set_attempts(webhook.attempts);
  proto.set_last_error(webhook.last_error);
  proto.set_delivered_event(webhook.delivered_event);
  return proto;
}

void SetTime(int64_t time_ms, google::protobuf::Timestamp* proto) {
  *proto = TimeUtil::MillisecondsToTimestamp(time_ms);
}

}  // namespace

google::protobuf::Duration DurationToProto(double seconds) {
  return TimeUtil::NanosecondsToDuration(static_cast<int64_t>(std::llround(1e9 * seconds)));
}

double SecondsOf(const google::protobuf::Duration& duration) {
  return static_cast<double>(duration.seconds()) + 1e-9 * duration.nanos();
}

Webhook WebhookFromProto(const v1::Webhook& proto) { return {proto.url(), proto.secret()}; }

Labels LabelsFromProto(const google::protobuf::Map<std::string, std::string>& proto) {
  return {proto.begin(), proto.end()};
}

v1::JobError ErrorToProto(const JobError& error) {
  v1::JobError proto;
  proto.set_code(static_cast<int>(error.code));
  // Paths also where the client's own words may be told: a worker reads its files elsewhere.
  const absl::Status status =
      MakeError(error.code, error.detail.reason, error.detail.field, error.message);
  proto.set_message(WithoutPaths(MessageForClients(status)));
  proto.mutable_detail()->set_reason(error.detail.reason);
  proto.mutable_detail()->set_field(error.detail.field);
  return proto;
}

absl::StatusOr<ReconstructOptions> OptionsFromProto(const v1::JobOptions& proto,
                                                    ReconstructOptions options) {
  absl::Status status;
  VisitFields(FieldsOf<ReconstructOptions>(), options,
              [&](const char* name, auto& value, const FieldRule&) {
                if (status.ok()) status = ReadField(proto, name, &value);
              });
  LITAGS_RETURN_IF_ERROR(status);
  LITAGS_RETURN_IF_ERROR(options.Validate());
  return options;
}

absl::StatusOr<JobPolicy> PolicyFromProto(const v1::JobPolicy& proto, JobPolicy policy) {
  if (proto.has_priority()) policy.priority = proto.priority();
  // As it was read, it is still whose it was.
  if (proto.has_max_run_time() && SecondsOf(proto.max_run_time()) != policy.max_run_seconds) {
    policy.max_run_seconds = SecondsOf(proto.max_run_time());
    policy.run_time_is_cap = false;
  }
  if (proto.has_max_memory_bytes()) policy.max_memory_bytes = proto.max_memory_bytes();
  if (proto.has_retention()) policy.retention_seconds = SecondsOf(proto.retention());
  if (proto.has_min_cores()) policy.min_cores = proto.min_cores();
  if (proto.has_min_memory_bytes()) policy.min_memory_bytes = proto.min_memory_bytes();
  if (proto.worker_labels_size() > 0) {
    policy.worker_labels = {proto.worker_labels().begin(), proto.worker_labels().end()};
  }
  LITAGS_RETURN_IF_ERROR(policy.Validate());
  return policy;
}

Tone ToneInForce(const ReconstructOptions& options) { return options.ResolveRecipe().tone.rule; }

v1::JobOptions OptionsToProto(const ReconstructOptions& options) {
  v1::JobOptions proto;
  VisitFields(FieldsOf<ReconstructOptions>(), options,
              [&](const char* name, const auto& value, const FieldRule&) {
                WriteField(name, value, &proto);
              });
  WriteField("tone", ToneInForce(options), &proto);
  return proto;
}

std::string JobName(std::string_view id) { return absl::StrCat("jobs/", std::string(id)); }

absl::StatusOr<v1::Job> JobToProto(const JobRecord& job) {
  v1::Job proto;
  proto.set_name(JobName(job.id));
  proto.set_display_name(job.display_name);
  proto.set_state(static_cast<v1::JobState>(job.state));
  proto.set_cancel_requested(job.cancel_requested);
  LITAGS_ASSIGN_OR_RETURN(const auto options, Decode<ReconstructOptions>(job.options));
  *proto.mutable_options() = OptionsToProto(options);
  proto.set_photos(static_cast<int32_t>(job.photos));
  proto.set_bytes(job.bytes);
  SetTime(job.create_time_ms, proto.mutable_create_time());
  if (job.start_time_ms) SetTime(job.start_time_ms, proto.mutable_start_time());
  if (job.end_time_ms) SetTime(job.end_time_ms, proto.mutable_end_time());
  LITAGS_ASSIGN_OR_RETURN(const JobPolicy policy, PolicyOf(job));
  *proto.mutable_policy() = PolicyToProto(policy);
  proto.set_owner(job.owner);
  LITAGS_ASSIGN_OR_RETURN(const Labels labels, LabelsOf(job));
  proto.mutable_labels()->insert(labels.begin(), labels.end());
  proto.set_etag(EtagOf(job));
  LITAGS_ASSIGN_OR_RETURN(const Webhook webhook, WebhookOf(job));
  if (!webhook.url.empty()) *proto.mutable_webhook() = WebhookToProto(webhook);
  if (job.expire_time_ms) SetTime(job.expire_time_ms, proto.mutable_expire_time());
  proto.set_attempt(job.attempt);
  proto.set_last_event(job.last_event);
  if (!job.progress.empty()) {
    LITAGS_ASSIGN_OR_RETURN(const auto progress, Decode<ProgressRecord>(job.progress));
    ProgressToProto(progress.progress, proto.mutable_progress());
  }
  if (job.snapshot_iteration >= 0) proto.set_snapshot_iteration(job.snapshot_iteration);
  if (!job.error.empty()) {
    LITAGS_ASSIGN_OR_RETURN(const auto error, Decode<JobError>(job.error));
    *proto.mutable_error() = ErrorToProto(error);
  }
  if (!job.report.empty()) {
    LITAGS_ASSIGN_OR_RETURN(const auto report, Decode<ReconstructReport>(job.report));
    ReportToProto(report, proto.mutable_report());
  }
  return proto;
}

absl::StatusOr<std::string> JobToJson(const JobRecord& job) {
  LITAGS_ASSIGN_OR_RETURN(const v1::Job proto, JobToProto(job));
  std::string json;
  if (google::protobuf::util::MessageToJsonString(proto, &json).ok()) return json;
  return absl::InternalError("the job cannot be written as JSON");
}

v1::LogEntry LogEntryToProto(const LogEntry& entry) {
  v1::LogEntry proto;
  proto.set_number(entry.number);
  SetTime(entry.time_ms, proto.mutable_time());
  proto.set_severity(static_cast<v1::LogSeverity>(entry.severity));
  proto.set_text(WithoutPaths(entry.text));
  return proto;
}

absl::StatusOr<v1::JobEvent> EventToProto(const EventRecord& event, std::string* preview) {
  preview->clear();
  v1::JobEvent proto;
  proto.set_number(event.number);
  SetTime(event.time_ms, proto.mutable_time());
  switch (event.kind) {
    case EventKind::kState: {
      LITAGS_ASSIGN_OR_RETURN(const auto change, Decode<StateChange>(event.payload));
      proto.mutable_state_change()->set_state(static_cast<v1::JobState>(change.state));
      proto.mutable_state_change()->set_message(WithoutPaths(change.message));
      if (change.error)
        *proto.mutable_state_change()->mutable_error() = ErrorToProto(*change.error);
      return proto;
    }
    case EventKind::kProgress: {
      LITAGS_ASSIGN_OR_RETURN(const auto progress, Decode<ProgressRecord>(event.payload));
      ProgressToProto(progress.progress, proto.mutable_progress());
      *preview = progress.preview;
      return proto;
    }
    case EventKind::kSnapshot: {
      LITAGS_ASSIGN_OR_RETURN(const auto snapshot, Decode<SnapshotRecord>(event.payload));
      proto.mutable_snapshot()->set_iteration(snapshot.iteration);
      return proto;
    }
  }
  return MakeError(absl::StatusCode::kInternal, "STORE_CORRUPT", "",
                   absl::StrCat("an event has the unknown kind ", static_cast<int>(event.kind)));
}

}  // namespace litags
