#include "server/jobs/codec.h"

#include <limits>
#include <nlohmann/json.hpp>
#include <set>
#include <string_view>

#include "absl/strings/str_cat.h"
#include "engine/core/json_text.h"

namespace litags {
namespace {

using Json = nlohmann::json;

// Each kind of record lists its fields once, in Fields(record, visit), for writing and reading.

template <typename R, typename F>
void Fields(R& r, F visit) requires std::is_same_v<std::remove_const_t<R>, ReconstructOptions> {
  VisitFields(FieldsOf<ReconstructOptions>(), r,
              [&](const char* name, auto& value, const FieldRule&) { visit(name, value); });
}

template <typename R, typename F>
void Fields(R& r, F visit) requires std::is_same_v<std::remove_const_t<R>, JobPolicy> {
  visit("priority", r.priority);
  visit("max_run_seconds", r.max_run_seconds);
  visit("run_time_is_cap", r.run_time_is_cap);
  visit("max_memory_bytes", r.max_memory_bytes);
  visit("retention_seconds", r.retention_seconds);
  visit("min_cores", r.min_cores);
  visit("min_memory_bytes", r.min_memory_bytes);
  visit("labels", r.worker_labels);
}

template <typename R, typename F>
void Fields(R& r, F visit) requires std::is_same_v<std::remove_const_t<R>, Resources> {
  visit("cores", r.cores);
  visit("memory_bytes", r.memory_bytes);
  visit("labels", r.labels);
}

template <typename R, typename F>
void Fields(R& r, F visit) requires std::is_same_v<std::remove_const_t<R>, JobError> {
  visit("code", r.code);
  visit("message", r.message);
  visit("reason", r.detail.reason);
  visit("field", r.detail.field);
}

template <typename R, typename F>
void Fields(R& r, F visit) requires std::is_same_v<std::remove_const_t<R>, StateChange> {
  visit("state", r.state);
  visit("message", r.message);
  visit("error", r.error);
}

template <typename R, typename F>
void Fields(R& r, F visit) requires std::is_same_v<std::remove_const_t<R>, ProgressRecord> {
  visit("stage", r.progress.stage);
  visit("message", r.progress.message);
  visit("iteration", r.progress.iteration);
  visit("iterations", r.progress.iterations);
  visit("loss", r.progress.loss);
  visit("loss_exposure", r.progress.loss_exposure);
  visit("loss_reconstruction", r.progress.loss_reconstruction);
  visit("loss_structure", r.progress.loss_structure);
  visit("loss_denoise", r.progress.loss_denoise);
  visit("psnr_holdout", r.progress.psnr_holdout);
  visit("gaussians", r.progress.gaussians);
  visit("iterations_per_second", r.progress.iterations_per_second);
  visit("eta_seconds", r.progress.eta_seconds);
  visit("preview", r.preview);
}

template <typename R, typename F>
void Fields(R& r, F visit) requires std::is_same_v<std::remove_const_t<R>, SnapshotRecord> {
  visit("iteration", r.iteration);
}

template <typename R, typename F>
void Fields(R& r, F visit) requires std::is_same_v<std::remove_const_t<R>, ReconstructReport> {
  visit("photos", r.photos);
  visit("registered", r.registered);
  visit("dropped", r.dropped);
  visit("sfm_preparation", r.sfm_preparation);
  visit("sparse_points", r.sparse_points);
  visit("gaussians", r.gaussians);
  visit("iterations", r.iterations);
  visit("seconds", r.seconds);
  visit("psnr_holdout", r.psnr_holdout);
  visit("ssim_holdout", r.ssim_holdout);
  visit("depth_used", r.depth_used);
  visit("notes", r.notes);
}

template <typename R, typename F>
void Fields(R& r, F visit) requires std::is_same_v<std::remove_const_t<R>, KeptFile> {
  visit("blob", r.blob);
  visit("bytes", r.bytes);
}

template <typename R, typename F>
void Fields(R& r, F visit) requires std::is_same_v<std::remove_const_t<R>, Webhook> {
  visit("url", r.url);
  visit("secret", r.secret);
  visit("attempts", r.attempts);
  visit("last_error", r.last_error);
  visit("delivered_event", r.delivered_event);
}

template <typename R>
Json ToJson(const R& record);
template <typename R>
void FromJson(const Json& json, R& record);

struct Writer {
  Json& json;
  template <typename T>
  void operator()(const char* key, const T& value) const {
    if constexpr (std::is_enum_v<T>) {
      json[key] = static_cast<int>(value);
    } else if constexpr (std::is_same_v<T, std::optional<JobError>>) {
      if (value) json[key] = ToJson(*value);
    } else if constexpr (std::is_same_v<T, std::optional<Tone>>) {
      if (value) json[key] = static_cast<int>(*value);
    } else {
      json[key] = value;  // NaN becomes null
    }
  }
};

struct Reader {
  const Json& json;
  template <typename T>
  void operator()(const char* key, T& value) const {
    const auto it = json.find(key);
    if (it == json.end()) return;
    if constexpr (std::is_enum_v<T>) {
      value = static_cast<T>(it->template get<int>());
    } else if constexpr (std::is_same_v<T, std::optional<JobError>>) {
      FromJson(*it, value.emplace());
    } else if constexpr (std::is_same_v<T, std::optional<Tone>>) {
      // Jobs of before 2026-11-25 may have a tone that is gone: they take the method's.
      const auto tone = static_cast<Tone>(it->template get<int>());
      if (WordOf(tone) != std::string("unknown")) value = tone;
    } else if constexpr (std::is_same_v<T, double>) {
      value = it->is_null() ? std::numeric_limits<double>::quiet_NaN() : it->template get<double>();
    } else {
      value = it->template get<T>();
    }
  }
};

template <typename R>
Json ToJson(const R& record) {
  Json json = Json::object();
  Fields(record, Writer{json});
  return json;
}

template <typename R>
void FromJson(const Json& json, R& record) {
  Fields(record, Reader{json});
}

template <>
Json ToJson(const KeptFiles& files) {
  Json json = Json::object();
  for (const auto& [name, file] : files) json[name] = ToJson(file);
  return json;
}

template <>
void FromJson(const Json& json, KeptFiles& files) {
  for (const auto& [name, file] : json.items()) FromJson(file, files[name]);
}

template <>
Json ToJson(const Labels& labels) {
  return Json(labels);
}

template <>
void FromJson(const Json& json, Labels& labels) {
  labels = json.get<Labels>();
}

template <typename R>
std::string EncodeRecord(const R& record) {
  // Messages may hold bytes of other programs' output: replace what is not UTF-8.
  return JsonText(ToJson(record));
}

}  // namespace

JobError JobError::Of(const absl::Status& status) {
  return {status.code(), std::string(status.message()),
          GetErrorDetail(status).value_or(ErrorDetail{"INTERNAL", ""})};
}

std::string Encode(const ReconstructOptions& options) { return EncodeRecord(options); }
std::string Encode(const JobPolicy& policy) { return EncodeRecord(policy); }
std::string Encode(const Resources& resources) { return EncodeRecord(resources); }
std::string Encode(const JobError& error) { return EncodeRecord(error); }
std::string Encode(const StateChange& change) { return EncodeRecord(change); }
std::string Encode(const ProgressRecord& progress) { return EncodeRecord(progress); }
std::string Encode(const SnapshotRecord& snapshot) { return EncodeRecord(snapshot); }
std::string Encode(const ReconstructReport& report) { return EncodeRecord(report); }
std::string Encode(const KeptFiles& files) { return EncodeRecord(files); }
std::string Encode(const Labels& labels) {
  return labels.empty() ? std::string() : EncodeRecord(labels);
}

std::string Encode(const Webhook& webhook) {
  return webhook.url.empty() ? std::string() : EncodeRecord(webhook);
}

void SetKept(JobRecord* job, const KeptFiles& files) {
  job->kept = Encode(files);
  job->kept_bytes = 0;
  std::set<std::string_view> counted;  // a finished scene may have two names
  for (const auto& [name, file] : files) {
    if (counted.insert(file.blob).second) job->kept_bytes += file.bytes;
  }
}

std::vector<std::string> Differences(const ReconstructOptions& a, const ReconstructOptions& b) {
  std::vector<std::string> values, names;
  VisitFields(FieldsOf<ReconstructOptions>(), a,
              [&](const char*, const auto& value, const FieldRule&) {
                values.push_back(FieldText(value));
              });
  size_t i = 0;
  VisitFields(FieldsOf<ReconstructOptions>(), b,
              [&](const char* name, const auto& value, const FieldRule&) {
                if (FieldText(value) != values[i++]) names.emplace_back(name);
              });
  return names;
}

template <typename T>
absl::StatusOr<T> Decode(std::string_view text) {
  const auto corrupt = [](const char* why) {
    return MakeError(absl::StatusCode::kInternal, "STORE_CORRUPT", "",
                     absl::StrCat("a stored record cannot be read: ", why));
  };
  const Json json = ParseJson(text);
  if (json.is_discarded()) return corrupt("it is no JSON");
  try {
    T record;
    FromJson(json, record);
    return record;
  } catch (const Json::exception& e) {
    return corrupt(e.what());
  }
}

template absl::StatusOr<ReconstructOptions> Decode(std::string_view);
template absl::StatusOr<JobPolicy> Decode(std::string_view);
template absl::StatusOr<Resources> Decode(std::string_view);
template absl::StatusOr<JobError> Decode(std::string_view);
template absl::StatusOr<StateChange> Decode(std::string_view);
template absl::StatusOr<ProgressRecord> Decode(std::string_view);
template absl::StatusOr<SnapshotRecord> Decode(std::string_view);
template absl::StatusOr<ReconstructReport> Decode(std::string_view);
template absl::StatusOr<KeptFiles> Decode(std::string_view);
template absl::StatusOr<Labels> Decode(std::string_view);
template absl::StatusOr<Webhook> Decode(std::string_view);

absl::StatusOr<Labels> LabelsOf(const JobRecord& job) {
  return job.labels.empty() ? Labels() : Decode<Labels>(job.labels);
}

absl::StatusOr<Webhook> WebhookOf(const JobRecord& job) {
  return job.webhook.empty() ? Webhook() : Decode<Webhook>(job.webhook);
}

absl::StatusOr<JobPolicy> PolicyOf(const JobRecord& job) {
  return job.policy.empty() ? JobPolicy() : Decode<JobPolicy>(job.policy);
}

}  // namespace litags
