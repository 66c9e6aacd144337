// Between the service's messages and the project's types.
#ifndef LITAGS_SERVER_API_CONVERT_H_
#define LITAGS_SERVER_API_CONVERT_H_

#include "absl/status/statusor.h"
#include "engine/pipeline/options.h"
#include "litags/v1/job.pb.h"
#include "server/jobs/codec.h"
#include "server/jobs/labels.h"
#include "server/jobs/policy.h"
#include "server/store/job_store.h"

namespace litags {

// Fields that are not set stay as they are in `options`. INVALID_ARGUMENT with the field
// "options.NAME".
absl::StatusOr<ReconstructOptions> OptionsFromProto(const v1::JobOptions& proto,
                                                    ReconstructOptions options = {});
// The same; INVALID_ARGUMENT (POLICY_OUT_OF_RANGE).
absl::StatusOr<JobPolicy> PolicyFromProto(const v1::JobPolicy& proto, JobPolicy policy = {});

google::protobuf::Duration DurationToProto(double seconds);
double SecondsOf(const google::protobuf::Duration& duration);

Webhook WebhookFromProto(const v1::Webhook& proto);
Labels LabelsFromProto(const google::protobuf::Map<std::string, std::string>& proto);

// The one that was asked for, else the method's.
Tone ToneInForce(const ReconstructOptions& options);
// Sets every field.
v1::JobOptions OptionsToProto(const ReconstructOptions& options);

v1::JobError ErrorToProto(const JobError& error);

std::string JobName(std::string_view id);  // "jobs/{id}"

// INTERNAL (STORE_CORRUPT) if what is stored cannot be read.
absl::StatusOr<v1::Job> JobToProto(const JobRecord& job);
// The job as GetJob has it, as JSON.
absl::StatusOr<std::string> JobToJson(const JobRecord& job);
v1::LogEntry LogEntryToProto(const LogEntry& entry);
// `preview` gets the digest of the event's picture; empty if it has none.
absl::StatusOr<v1::JobEvent> EventToProto(const EventRecord& event, std::string* preview);

}  // namespace litags

#endif  // LITAGS_SERVER_API_CONVERT_H_
