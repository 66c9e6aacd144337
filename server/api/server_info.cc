#include "server/api/server_info.h"

#include <algorithm>
#include <limits>
#include <optional>
#include <type_traits>

#include "engine/core/camera.h"
#include "engine/core/error.h"
#include "engine/core/fields.h"
#include "engine/core/limits.h"
#include "engine/pipeline/options.h"
#include "server/api/convert.h"
#include "server/jobs/jobs.h"

namespace litags {
namespace {

template <class T>
struct FieldType {
  using type = T;
};
template <class T>
struct FieldType<std::optional<T>> {
  using type = T;
};

void AddMethods(v1::ServerInfo* info) {
  for (const auto& [method, word] : EnumWords<Method>::kWords) {
    ReconstructOptions defaults;
    defaults.method = method;
    v1::MethodInfo* proto = info->add_methods();
    *proto->mutable_defaults() = OptionsToProto(defaults);
    proto->set_method(proto->defaults().method());
    proto->set_name(word);
  }
}

// "maximum" of an option is the operator's cap where that is less.
void ApplyCap(int64_t cap, v1::OptionInfo* option) {
  if (cap <= 0) return;
  const auto most = static_cast<double>(cap);
  if (!option->has_maximum() || most < option->maximum()) option->set_maximum(most);
}

void AddOptions(const JobCaps& caps, v1::ServerInfo* info) {
  const ReconstructOptions defaults;
  VisitFields(FieldsOf<ReconstructOptions>(), defaults,
              [&](const char* name, const auto& value, const FieldRule& rule) {
                using Type = typename FieldType<std::decay_t<decltype(value)>>::type;
                v1::OptionInfo* proto = info->add_options();
                proto->set_name(name);
                proto->set_help(rule.help);
                if (rule.least > std::numeric_limits<double>::lowest()) {
                  proto->set_minimum(rule.least);
                }
                if (rule.most < std::numeric_limits<double>::max()) proto->set_maximum(rule.most);
                proto->set_minimum_excluded(rule.above_least);
                proto->set_maximum_excluded(rule.below_most);
                if (proto->name() == "iterations") ApplyCap(caps.max_iterations, proto);
                if (proto->name() == "max_gaussians") ApplyCap(caps.max_gaussians, proto);
                if (rule.zero != nullptr) proto->set_zero_means(rule.zero);
                if constexpr (std::is_enum_v<Type>) {
                  for (const auto& [choice, word] : EnumWords<Type>::kWords) {
                    proto->add_choices(word);
                  }
                }
              });
}

void SetJobLimits(const UploadLimits& uploads, const JobCaps& caps, v1::JobLimits* proto) {
  proto->set_max_files(uploads.max_files);
  proto->set_max_file_bytes(uploads.max_file_bytes);
  proto->set_max_job_bytes(uploads.max_job_bytes);
  proto->set_max_photo_pixels(kMaxImagePixels);
  proto->set_min_photos(static_cast<int>(kMinPhotos));
  proto->set_max_iterations(caps.max_iterations);
  proto->set_max_gaussians(caps.max_gaussians);
  if (caps.max_run_seconds > 0) {
    *proto->mutable_max_run_time() = DurationToProto(caps.max_run_seconds);
  }
  proto->set_max_priority(caps.max_priority);
  proto->set_max_memory_bytes(caps.max_memory_bytes);
}

}  // namespace

absl::StatusOr<v1::ServerInfo> DescribeServer(const Call& call) {
  v1::ServerInfo info;
  info.set_version(LITAGS_VERSION);
  AddMethods(&info);
  Jobs& jobs = *call.jobs();
  AddOptions(jobs.caps(), &info);
  LITAGS_ASSIGN_OR_RETURN(const Workforce workers, jobs.Workers());
  info.set_workers(static_cast<int>(workers.size()));
  info.set_depth_network(std::any_of(workers.begin(), workers.end(), HasDepthNetwork));
  SetJobLimits(jobs.uploads().limits(), jobs.caps(), info.mutable_job_limits());

  v1::ClientUse* client = info.mutable_client();
  client->set_name(call.client().name);
  client->set_admin(call.client().admin);
  LITAGS_ASSIGN_OR_RETURN(const OwnerUsage usage, jobs.UsageOf(call.client().name));
  const ClientLimits& limits = call.limits();
  client->set_jobs(usage.jobs);
  client->set_max_jobs(limits.max_jobs);
  client->set_bytes(usage.bytes);
  client->set_max_bytes(limits.max_bytes);
  client->set_max_streams(limits.max_streams);
  client->set_pictures_per_second(limits.pictures_per_second);
  return info;
}

}  // namespace litags
