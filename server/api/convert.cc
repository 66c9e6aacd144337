#include "server/api/convert.h"

#include <google/protobuf/util/time_util.h>

#include <cmath>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "litags/v1/reconstruction_service.pb.h"
#include "server/jobs/codec.h"

namespace litags {
namespace {

using google::protobuf::util::TimeUtil;

// Enumerations of engine and proto have the same order; proto has UNSPECIFIED in front.
static_assert(static_cast<int>(Method::kLitaGs) + 1 == v1::METHOD_LITA_GS);
static_assert(static_cast<int>(Method::k3dgs) + 1 == v1::METHOD_3DGS);
static_assert(static_cast<int>(Tone::kPaper) + 1 == v1::TONE_PAPER);
static_assert(static_cast<int>(Tone::kLinearGain) + 1 == v1::TONE_LINEAR_GAIN);
static_assert(static_cast<int>(Tone::kNone) + 1 == v1::TONE_NONE);
static_assert(static_cast<int>(DepthOrigin::kAuto) + 1 == v1::DEPTH_SOURCE_AUTO);
static_assert(static_cast<int>(DepthOrigin::kMaps) + 1 == v1::DEPTH_SOURCE_MAPS);
static_assert(static_cast<int>(DepthOrigin::kStereo) + 1 == v1::DEPTH_SOURCE_STEREO);
static_assert(static_cast<int>(DepthOrigin::kNetwork) + 1 == v1::DEPTH_SOURCE_NETWORK);
static_assert(static_cast<int>(DepthOrigin::kNone) + 1 == v1::DEPTH_SOURCE_NONE);
static_assert(static_cast<int>(Tone::kCapture) + 1 == v1::TONE_CAPTURE);
static_assert(static_cast<int>(WhiteBalance::kCamera) + 1 == v1::WHITE_BALANCE_CAMERA);
static_assert(static_cast<int>(WhiteBalance::kScene) + 1 == v1::WHITE_BALANCE_SCENE);
static_assert(static_cast<int>(Stage::kLoading) + 1 == v1::STAGE_LOADING);
static_assert(static_cast<int>(Stage::kSaving) + 1 == v1::STAGE_SAVING);
static_assert(static_cast<int>(JobState::kUploading) == v1::JOB_STATE_UPLOADING);
static_assert(static_cast<int>(JobState::kCancelled) == v1::JOB_STATE_CANCELLED);
static_assert(static_cast<int>(FileRole::kPhoto) == v1::FILE_ROLE_PHOTO);
static_assert(static_cast<int>(FileRole::kArchive) == v1::FILE_ROLE_ARCHIVE);
static_assert(static_cast<int>(FileRole::kMask) == v1::FILE_ROLE_MASK);

absl::Status UnknownEnum(const char* field, int value) {
  return InvalidInput("OPTION_OUT_OF_RANGE", field,
                      absl::StrCat(field, " has the value ", value,
                                   ", which this server does not know; see job.proto"));
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
  proto->set_eta_seconds(progress.eta_seconds);
}

void ErrorToProto(const JobError& error, v1::JobError* proto) {
  proto->set_code(static_cast<int>(error.code));
  proto->set_message(error.message);
  proto->mutable_detail()->set_reason(error.detail.reason);
  proto->mutable_detail()->set_field(error.detail.field);
}

void ReportToProto(const ReconstructReport& report, v1::JobReport* proto) {
  proto->set_photos(report.photos);
  proto->set_registered(report.registered);
  for (const std::string& name : report.dropped) proto->add_dropped(name);
  proto->set_sfm_preparation(report.sfm_preparation);
  proto->set_sparse_points(report.sparse_points);
  proto->set_gaussians(report.gaussians);
  proto->set_iterations(report.iterations);
  proto->set_seconds(report.seconds);
  if (std::isfinite(report.psnr_holdout)) proto->set_psnr_holdout(report.psnr_holdout);
  proto->set_depth_used(report.depth_used);
  for (const std::string& note : report.notes) proto->add_notes(note);
}

void SetTime(int64_t time_ms, google::protobuf::Timestamp* proto) {
  *proto = TimeUtil::MillisecondsToTimestamp(time_ms);
}

}  // namespace

absl::StatusOr<ReconstructOptions> OptionsFromProto(const v1::JobOptions& proto,
                                                    ReconstructOptions options) {
  if (proto.has_method() && proto.method() != v1::METHOD_UNSPECIFIED) {
    if (!v1::Method_IsValid(proto.method())) return UnknownEnum("options.method", proto.method());
    options.method = static_cast<Method>(proto.method() - 1);
  }
  if (proto.has_tone() && proto.tone() != v1::TONE_UNSPECIFIED) {
    if (!v1::Tone_IsValid(proto.tone())) return UnknownEnum("options.tone", proto.tone());
    options.tone = static_cast<Tone>(proto.tone() - 1);
  }
  if (proto.has_white_balance() && proto.white_balance() != v1::WHITE_BALANCE_UNSPECIFIED) {
    if (!v1::WhiteBalance_IsValid(proto.white_balance()))
      return UnknownEnum("options.white_balance", proto.white_balance());
    options.white_balance = static_cast<WhiteBalance>(proto.white_balance() - 1);
  }
  if (proto.has_depth_source() && proto.depth_source() != v1::DEPTH_SOURCE_UNSPECIFIED) {
    if (!v1::DepthSource_IsValid(proto.depth_source()))
      return UnknownEnum("options.depth_source", proto.depth_source());
    options.depth_source = static_cast<DepthOrigin>(proto.depth_source() - 1);
  }
  if (proto.has_density_statistic() &&
      proto.density_statistic() != v1::DENSITY_STATISTIC_UNSPECIFIED) {
    if (!v1::DensityStatistic_IsValid(proto.density_statistic()))
      return UnknownEnum("options.density_statistic", proto.density_statistic());
    options.density_statistic = static_cast<DensityStatistic>(proto.density_statistic() - 1);
  }
  if (proto.has_density_growth() && proto.density_growth() != v1::DENSITY_GROWTH_UNSPECIFIED) {
    if (!v1::DensityGrowth_IsValid(proto.density_growth()))
      return UnknownEnum("options.density_growth", proto.density_growth());
    options.density_growth = static_cast<DensityGrowth>(proto.density_growth() - 1);
  }
  if (proto.has_theta()) options.theta = proto.theta();
  if (proto.has_iterations()) options.iterations = proto.iterations();
  if (proto.has_seed()) options.seed = proto.seed();
  if (proto.has_threads()) options.threads = proto.threads();
  if (proto.has_max_gaussians()) options.max_gaussians = proto.max_gaussians();
  if (proto.has_sh_degree()) options.sh_degree = proto.sh_degree();
  if (proto.has_use_pdm()) options.use_pdm = proto.use_pdm();
  if (proto.has_use_prior()) options.use_prior = proto.use_prior();
  if (proto.has_prior_geometry()) options.prior_geometry = proto.prior_geometry();
  if (proto.has_use_depth()) options.use_depth = proto.use_depth();
  if (proto.has_max_image_side()) options.max_image_side = proto.max_image_side();
  if (proto.has_holdout_every()) options.holdout_every = proto.holdout_every();
  if (proto.has_min_registered()) options.min_registered = proto.min_registered();
  if (proto.has_checkpoint_every()) options.checkpoint_every = proto.checkpoint_every();
  if (proto.has_preview_every()) options.preview_every = proto.preview_every();
  if (proto.has_exposure_ssim()) options.exposure_ssim = proto.exposure_ssim();
  if (proto.has_pdm_hidden()) options.pdm_hidden = proto.pdm_hidden();
  if (proto.has_pdm_every()) options.pdm_every = proto.pdm_every();
  if (proto.has_coarse_levels()) options.coarse_levels = proto.coarse_levels();
  if (proto.has_coarse_until()) options.coarse_until = proto.coarse_until();
  if (proto.has_depth_weight()) options.depth_weight = proto.depth_weight();
  if (proto.has_dense_start()) options.dense_start = proto.dense_start();
  if (proto.has_depth_geometry()) options.depth_geometry = proto.depth_geometry();
  if (proto.has_settle_epochs()) options.settle_epochs = proto.settle_epochs();
  if (proto.has_dropout()) options.dropout = proto.dropout();
  if (proto.has_noise_filter()) options.noise_filter = proto.noise_filter();
  if (proto.has_antialiased()) options.antialiased = proto.antialiased();
  if (proto.has_information_weights()) options.information_weights = proto.information_weights();
  if (proto.has_contrast()) options.contrast = proto.contrast();
  if (proto.has_chroma_smoothing()) options.chroma_smoothing = proto.chroma_smoothing();
  if (proto.has_schedule_iterations()) options.schedule_iterations = proto.schedule_iterations();

  const absl::Status valid = options.Validate();
  if (valid.ok()) return options;
  // The engine knows its fields, not where they stand in the request.
  const ErrorDetail detail = GetErrorDetail(valid).value_or(ErrorDetail{"OPTION_OUT_OF_RANGE", ""});
  const bool placed = detail.field.starts_with("options.");
  return MakeError(valid.code(), detail.reason,
                   placed ? detail.field : absl::StrCat("options.", detail.field),
                   std::string(valid.message()));
}

absl::StatusOr<JobPolicy> PolicyFromProto(const v1::JobPolicy& proto, JobPolicy policy) {
  if (proto.has_priority()) policy.priority = proto.priority();
  if (proto.has_max_run_seconds()) policy.max_run_seconds = proto.max_run_seconds();
  if (proto.has_max_memory_bytes()) policy.max_memory_bytes = proto.max_memory_bytes();
  if (proto.has_retention_seconds()) policy.retention_seconds = proto.retention_seconds();
  if (proto.has_min_cores()) policy.min_cores = proto.min_cores();
  if (proto.has_min_memory_bytes()) policy.min_memory_bytes = proto.min_memory_bytes();
  if (proto.labels_size() > 0) policy.labels = {proto.labels().begin(), proto.labels().end()};
  LITAGS_RETURN_IF_ERROR(policy.Validate());
  return policy;
}

v1::JobOptions OptionsToProto(const ReconstructOptions& options) {
  v1::JobOptions proto;
  proto.set_method(static_cast<v1::Method>(static_cast<int>(options.method) + 1));
  proto.set_tone(static_cast<v1::Tone>(static_cast<int>(options.tone) + 1));
  proto.set_white_balance(
      static_cast<v1::WhiteBalance>(static_cast<int>(options.white_balance) + 1));
  proto.set_theta(options.theta);
  proto.set_iterations(options.iterations);
  proto.set_seed(options.seed);
  proto.set_threads(options.threads);
  proto.set_max_gaussians(options.max_gaussians);
  proto.set_sh_degree(options.sh_degree);
  proto.set_use_pdm(options.use_pdm);
  proto.set_use_prior(options.use_prior);
  proto.set_use_depth(options.use_depth);
  proto.set_max_image_side(options.max_image_side);
  proto.set_holdout_every(options.holdout_every);
  proto.set_min_registered(options.min_registered);
  proto.set_checkpoint_every(options.checkpoint_every);
  proto.set_preview_every(options.preview_every);
  proto.set_exposure_ssim(options.exposure_ssim);
  proto.set_pdm_hidden(options.pdm_hidden);
  proto.set_pdm_every(options.pdm_every);
  proto.set_coarse_levels(options.coarse_levels);
  proto.set_coarse_until(options.coarse_until);
  proto.set_depth_source(static_cast<v1::DepthSource>(static_cast<int>(options.depth_source) + 1));
  proto.set_depth_weight(options.depth_weight);
  proto.set_dense_start(options.dense_start);
  proto.set_depth_geometry(options.depth_geometry);
  proto.set_contrast(options.contrast);
  proto.set_chroma_smoothing(options.chroma_smoothing);
  proto.set_settle_epochs(options.settle_epochs);
  proto.set_dropout(options.dropout);
  proto.set_noise_filter(options.noise_filter);
  proto.set_antialiased(options.antialiased);
  proto.set_information_weights(options.information_weights);
  proto.set_schedule_iterations(options.schedule_iterations);
  proto.set_density_statistic(
      static_cast<v1::DensityStatistic>(static_cast<int>(options.density_statistic) + 1));
  proto.set_density_growth(
      static_cast<v1::DensityGrowth>(static_cast<int>(options.density_growth) + 1));
  proto.set_prior_geometry(options.prior_geometry);
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
  if (!job.policy.empty()) {
    LITAGS_ASSIGN_OR_RETURN(const auto policy, Decode<JobPolicy>(job.policy));
    proto.mutable_policy()->set_priority(policy.priority);
    proto.mutable_policy()->set_max_run_seconds(policy.max_run_seconds);
    proto.mutable_policy()->set_max_memory_bytes(policy.max_memory_bytes);
    proto.mutable_policy()->set_retention_seconds(policy.retention_seconds);
    proto.mutable_policy()->set_min_cores(policy.min_cores);
    proto.mutable_policy()->set_min_memory_bytes(policy.min_memory_bytes);
    proto.mutable_policy()->mutable_labels()->Add(policy.labels.begin(), policy.labels.end());
  }
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
    ErrorToProto(error, proto.mutable_error());
  }
  if (!job.report.empty()) {
    LITAGS_ASSIGN_OR_RETURN(const auto report, Decode<ReconstructReport>(job.report));
    ReportToProto(report, proto.mutable_report());
  }
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
      proto.mutable_state_change()->set_message(change.message);
      if (change.error) ErrorToProto(*change.error, proto.mutable_state_change()->mutable_error());
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
