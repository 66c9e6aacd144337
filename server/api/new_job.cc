#include "server/api/new_job.h"

#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/io/zero_copy_stream_impl_lite.h>

#include <optional>
#include <string_view>
#include <vector>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/core/utf8.h"
#include "proto/litags/v1/limits.h"
#include "server/api/convert.h"
#include "server/jobs/codec.h"
#include "server/store/digest.h"

namespace litags {
namespace {

constexpr size_t kMaxRequestIdLength = 64;
constexpr size_t kMaxContentDigestBytes = 64;

// Lists and logs, also an administrator's, show it as it is.
absl::Status CheckText(const std::string& text, const char* field) {
  if (!HoldsControl(text)) return absl::OkStatus();
  return InvalidInput("TEXT_INVALID", field,
                      absl::StrCat(field,
                                   " holds a control character, a line break, or a character that "
                                   "turns text around; leave it out"));
}

absl::Status CheckDisplayName(const std::string& name) {
  constexpr char kField[] = "display_name";
  LITAGS_RETURN_IF_ERROR(CheckText(name, kField));
  if (name.size() <= v1::kMaxDisplayNameBytes) return absl::OkStatus();
  return InvalidInput("DISPLAY_NAME_TOO_LONG", kField,
                      absl::StrCat(kField, " has ", name.size(), " bytes; at most ",
                                   v1::kMaxDisplayNameBytes, " are allowed"));
}

// Whether all are set, as in Job.options: they are those of a job, some changed.
bool HasAll(const v1::JobOptions& options) {
  std::vector<const google::protobuf::FieldDescriptor*> fields;
  options.GetReflection()->ListFields(options, &fields);
  return static_cast<int>(fields.size()) == options.GetDescriptor()->field_count();
}

}  // namespace

std::string DigestOf(const google::protobuf::Message& request) {
  std::string bytes;
  {
    google::protobuf::io::StringOutputStream stream(&bytes);
    google::protobuf::io::CodedOutputStream coded(&stream);
    coded.SetSerializationDeterministic(true);
    request.SerializeToCodedStream(&coded);
  }
  return Sha256::Hex(bytes);
}

absl::Status CheckRequestId(const std::string& request_id) {
  if (request_id.size() > kMaxRequestIdLength) {
    return InvalidInput("REQUEST_ID_INVALID", "request_id",
                        absl::StrCat("request_id has ", request_id.size(), " characters; at most ",
                                     kMaxRequestIdLength, " are allowed, a UUID has 36"));
  }
  return CheckText(request_id, "request_id");
}

absl::StatusOr<NewJob> NewJobOf(const v1::CreateJobRequest& request) {
  LITAGS_RETURN_IF_ERROR(CheckRequestId(request.request_id()));
  LITAGS_RETURN_IF_ERROR(CheckDisplayName(request.display_name()));
  if (request.content_digest().size() > kMaxContentDigestBytes) {
    return InvalidInput(
        "CONTENT_DIGEST_INVALID", "content_digest",
        absl::StrCat("content_digest has ", request.content_digest().size(), " bytes; at most ",
                     kMaxContentDigestBytes, " are allowed, SHA-256 has 32"));
  }
  NewJob job{request.request_id(), request.display_name(), ToHex(request.content_digest()), {}, {}};
  LITAGS_ASSIGN_OR_RETURN(job.policy, PolicyFromProto(request.policy()));
  LITAGS_ASSIGN_OR_RETURN(job.options, OptionsFromProto(request.options()));
  job.labels = LabelsFromProto(request.labels());
  job.webhook = WebhookFromProto(request.webhook());
  job.request_digest = DigestOf(request);
  return job;
}

absl::StatusOr<NewJob> NewJobOf(const v1::CloneJobRequest& request, const JobRecord& source) {
  LITAGS_RETURN_IF_ERROR(CheckRequestId(request.request_id()));
  LITAGS_RETURN_IF_ERROR(CheckDisplayName(request.display_name()));
  NewJob job{request.request_id(), request.display_name(), "", {}, {}};
  LITAGS_ASSIGN_OR_RETURN(ReconstructOptions options, Decode<ReconstructOptions>(source.options));
  const std::optional<Tone> tone = options.tone;
  const Tone tone_in_force = ToneInForce(options);
  LITAGS_ASSIGN_OR_RETURN(job.options, OptionsFromProto(request.options(), options));
  if (HasAll(request.options()) && job.options.tone == tone_in_force) job.options.tone = tone;
  LITAGS_ASSIGN_OR_RETURN(const JobPolicy policy, PolicyOf(source));
  LITAGS_ASSIGN_OR_RETURN(job.policy, PolicyFromProto(request.policy(), policy.WithoutCap()));
  job.labels = LabelsFromProto(request.labels());
  job.webhook = WebhookFromProto(request.webhook());
  job.request_digest = DigestOf(request);
  return job;
}

absl::Status ApplyUpdate(const v1::UpdateJobRequest& request, JobDetails* details) {
  const v1::Job& job = request.job();
  if (request.update_mask().paths().empty()) {
    return InvalidInput("UPDATE_MASK_EMPTY", "update_mask",
                        "update_mask is empty; name what is to change, such as \"display_name\"");
  }
  constexpr std::string_view kLabel = "labels.";
  for (const std::string& path : request.update_mask().paths()) {
    if (path == "display_name") {
      LITAGS_RETURN_IF_ERROR(CheckDisplayName(job.display_name()));
      details->display_name = job.display_name();
    } else if (path == "labels") {
      details->labels = LabelsFromProto(job.labels());
    } else if (path.starts_with(kLabel) && path.size() > kLabel.size()) {
      const std::string key = path.substr(kLabel.size());
      const auto value = job.labels().find(key);
      if (value == job.labels().end()) {
        details->labels.erase(key);
      } else {
        details->labels[key] = value->second;
      }
    } else if (path == "policy.priority") {
      details->priority = job.policy().priority();
    } else if (path == "policy.retention") {
      details->retention_seconds = SecondsOf(job.policy().retention());
    } else if (path == "policy.worker_labels") {
      const auto& labels = job.policy().worker_labels();
      details->worker_labels = {labels.begin(), labels.end()};
    } else {
      return InvalidInput(
          "UPDATE_MASK_INVALID", "update_mask",
          absl::StrCat("update_mask: \"", path,
                       "\" cannot be changed; display_name, labels, labels.KEY, "
                       "policy.priority, policy.retention and policy.worker_labels can"));
    }
  }
  return absl::OkStatus();
}

}  // namespace litags
