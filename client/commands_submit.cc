// litags submit: a folder of photos becomes a job.
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <map>
#include <memory>
#include <optional>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "client/cli.h"
#include "client/status.h"
#include "client/text.h"
#include "client/treatment.h"
#include "client/upload.h"

namespace litags::client {
namespace {

struct SubmitArgs {
  std::string dir, cameras, depth_dir, masks_dir, name, request_id;
  bool watch = false;
  // Only what was given is sent; the service has the defaults.
  std::optional<v1::Method> method;
  std::optional<v1::Tone> tone;
  std::optional<v1::WhiteBalance> white_balance;
  std::optional<v1::DepthSource> depth_source;
  std::optional<v1::DensityStatistic> density_statistic;
  std::optional<v1::DensityGrowth> density_growth;
  std::optional<double> theta, contrast, chroma_smoothing, min_registered, exposure_ssim,
      coarse_until, settle_epochs, dropout, depth_weight;
  std::optional<int> iterations, schedule_iterations, threads, sh_degree, max_image_side,
      holdout_every;
  std::optional<int> checkpoint_every, preview_every, pdm_hidden, pdm_every, coarse_levels;
  std::optional<uint64_t> seed;
  std::optional<int64_t> max_gaussians;
  std::optional<bool> depth_geometry, use_pdm;
  Treatment treatment;
  bool no_prior = false, prior_geometry = false, no_depth = false, no_dense_start = false,
       no_noise_filter = false, no_antialiasing = false, no_information_weights = false;
};

// An option that takes one of a few words.
template <class Value>
CLI::Option* AddChoice(CLI::App& command, const std::string& name, std::optional<Value>& value,
                       const std::map<std::string, Value>& choices) {
  return command.add_option_function<std::string>(
      name, [name, &value, choices](const std::string& word) {
        const auto found = choices.find(word);
        if (found != choices.end()) {
          value = found->second;
          return;
        }
        std::string words;
        for (const auto& choice : choices) absl::StrAppend(&words, " ", choice.first);
        throw CLI::ValidationError(
            name, absl::StrCat("there is no \"", word, "\"; choose one of:", words));
      });
}

v1::JobOptions MakeOptions(const SubmitArgs& args) {
  v1::JobOptions options;
  if (args.method) options.set_method(*args.method);
  if (args.tone) options.set_tone(*args.tone);
  if (args.white_balance) options.set_white_balance(*args.white_balance);
  if (args.theta) options.set_theta(*args.theta);
  if (args.contrast) options.set_contrast(*args.contrast);
  if (args.chroma_smoothing) options.set_chroma_smoothing(*args.chroma_smoothing);
  if (args.iterations) options.set_iterations(*args.iterations);
  if (args.schedule_iterations) options.set_schedule_iterations(*args.schedule_iterations);
  if (args.seed) options.set_seed(*args.seed);
  if (args.threads) options.set_threads(*args.threads);
  if (args.max_gaussians) options.set_max_gaussians(*args.max_gaussians);
  if (args.sh_degree) options.set_sh_degree(*args.sh_degree);
  if (args.use_pdm) options.set_use_pdm(*args.use_pdm);
  if (args.no_prior) options.set_use_prior(false);
  if (args.prior_geometry) options.set_prior_geometry(true);
  if (args.no_depth) options.set_use_depth(false);
  if (args.no_noise_filter) options.set_noise_filter(false);
  if (args.no_antialiasing) options.set_antialiased(false);
  if (args.no_dense_start) options.set_dense_start(false);
  if (args.max_image_side) options.set_max_image_side(*args.max_image_side);
  if (args.holdout_every) options.set_holdout_every(*args.holdout_every);
  if (args.min_registered) options.set_min_registered(*args.min_registered);
  if (args.checkpoint_every) options.set_checkpoint_every(*args.checkpoint_every);
  if (args.preview_every) options.set_preview_every(*args.preview_every);
  if (args.exposure_ssim) options.set_exposure_ssim(*args.exposure_ssim);
  if (args.pdm_hidden) options.set_pdm_hidden(*args.pdm_hidden);
  if (args.pdm_every) options.set_pdm_every(*args.pdm_every);
  if (args.coarse_levels) options.set_coarse_levels(*args.coarse_levels);
  if (args.coarse_until) options.set_coarse_until(*args.coarse_until);
  if (args.settle_epochs) options.set_settle_epochs(*args.settle_epochs);
  if (args.dropout) options.set_dropout(*args.dropout);
  if (args.no_information_weights) options.set_information_weights(false);
  if (args.depth_source) options.set_depth_source(*args.depth_source);
  if (args.depth_weight) options.set_depth_weight(*args.depth_weight);
  if (args.depth_geometry) options.set_depth_geometry(*args.depth_geometry);
  if (args.density_statistic) options.set_density_statistic(*args.density_statistic);
  if (args.density_growth) options.set_density_growth(*args.density_growth);
  return options;
}

// The first few of some names.
std::string ShortList(std::vector<std::string> names) {
  constexpr size_t kShown = 5;
  const size_t more = names.size() > kShown ? names.size() - kShown : 0;
  names.resize(names.size() - more);
  return absl::StrCat(absl::StrJoin(names, ", "),
                      more > 0 ? absl::StrCat(" and ", more, " more") : "");
}

void NoteSkipped(const Capture& capture) {
  if (capture.skipped.empty()) return;
  Note(absl::StrCat(
      "not sent, since the names are not those of photos: ", ShortList(capture.skipped),
      capture.files.back().role == v1::FILE_ROLE_PHOTO
          ? " (known cameras go with --cameras, depth maps with --depth, masks with --masks)"
          : ""));
}

void NoteMasks(const Capture& capture) {
  if (capture.masks_dir.empty()) return;
  const auto masks =
      std::count_if(capture.files.begin(), capture.files.end(),
                    [](const LocalFile& file) { return file.role == v1::FILE_ROLE_MASK; });
  Note(absl::StrCat("with ", masks, masks == 1 ? " mask" : " masks", " from ", capture.masks_dir,
                    ": what is 0 there is not learnt"));
}

// The upload's progress: drawn anew on a terminal, else said at the end only.
void NoteUpload(const UploadProgress& progress) {
  const std::string text =
      absl::StrCat("uploaded ", progress.files_done, "/", progress.files, " files, ",
                   BytesText(progress.bytes_done), " of ", BytesText(progress.bytes));
  const bool done = progress.files_done == progress.files;
  if (done && !progress.skipped.empty()) {
    Note(absl::StrCat("not used, of what is in the archive: ", ShortList(progress.skipped)));
  }
  if (isatty(STDERR_FILENO)) {
    std::fprintf(stderr, "\r%s\x1b[K%s", text.c_str(), done ? "\n" : "");
    std::fflush(stderr);
  } else if (done) {
    Note(text);
  }
}

// What becomes of a job whose submission failed: without a request id nobody could continue it.
void CleanUp(Session& session, const SubmitArgs& args, const std::string& job,
             const absl::Status& why) {
  if (!args.request_id.empty()) {
    Note(absl::StrCat(job, " is kept; the same command continues the upload"));
    return;
  }
  absl::Status removed = why;
  if (!absl::IsCancelled(why) && !absl::IsUnavailable(why)) {
    removed = session.client().DeleteJob(job);
  } else if (absl::IsCancelled(why)) {
    Interrupt fresh;
    ClientOptions options;
    options.retry_seconds = 0;
    options.call_seconds = 5;
    // The channel was made once from the same options.
    const auto channel = Connect(session.connection);
    removed = channel.ok() ? Client(*channel, options, fresh).DeleteJob(job) : channel.status();
  }
  Note(removed.ok() ? absl::StrCat(job, " was removed again")
                    : absl::StrCat(job,
                                   " was not started and is still there; remove it with: "
                                   "litags delete ",
                                   job));
}

absl::Status UploadAndStart(Session& session, const std::string& job, Capture& capture) {
  absl::Status status = UploadFiles(session.client(), job, capture.files, NoteUpload);
  if (!status.ok()) return status;
  return session.client().StartJob(job).status();
}

int Submit(Session& session, const SubmitArgs& args) {
  auto capture = ScanCapture(args.dir, args.cameras, args.depth_dir, args.masks_dir);
  if (!capture.ok()) return ReportError(session, capture.status());
  NoteSkipped(*capture);
  NoteMasks(*capture);

  v1::CreateJobRequest request;
  request.set_display_name(args.name);
  request.set_request_id(args.request_id);
  *request.mutable_options() = MakeOptions(args);
  *request.mutable_policy() = ToProto(args.treatment);
  if (!args.request_id.empty()) {
    auto digest = ContentDigest(capture->files);
    if (!digest.ok()) return ReportError(session, digest.status());
    request.set_content_digest(*std::move(digest));
  }
  const auto job = session.client().CreateJob(std::move(request));
  if (!job.ok()) return ReportError(session, job.status());

  if (job->state() == v1::JOB_STATE_UPLOADING) {
    const absl::Status status = UploadAndStart(session, job->name(), *capture);
    if (!status.ok()) {
      const int exit_code = ReportError(session, status, job->name());
      CleanUp(session, args, job->name(), status);
      return exit_code;
    }
  } else {
    Note(absl::StrCat(job->name(), " was submitted before and is ", StateText(job->state())));
  }
  std::printf("%s\n", job->name().c_str());
  std::fflush(stdout);
  if (args.watch) return FollowJob(session, job->name(), 0, stderr, /*json=*/false);
  NoteWaiting(session, job->name());
  Note(absl::StrCat("follow it with: litags watch ", job->name()));
  return kExitOk;
}

}  // namespace

void AddSubmitCommand(CLI::App& app, Session& session) {
  auto args = std::make_shared<SubmitArgs>();
  CLI::App* command = app.add_subcommand(
      "submit", "Send a folder of photos and start its reconstruction; prints the job's name");
  command
      ->add_option(
          "DIR", args->dir,
          "Folder with the photos (of its subfolders only masks is read), or a .zip, .tar or "
          ".tar.gz of it")
      ->required();
  command->add_flag("--watch", args->watch, "Then follow the job until it ends");
  command->add_option("--name", args->name, "Title for humans");
  command->add_option("--cameras", args->cameras,
                      "Known cameras: a transforms.json, or the folder of a COLMAP model");
  command->add_option("--depth", args->depth_dir,
                      "Folder with depth maps, named as the photos (.png 16 bit, .pfm, .npy)");
  command->add_option("--masks", args->masks_dir,
                      "Folder with masks of photos, <photo's name>.png, 0 where a pixel is not of "
                      "the scene; default: DIR/masks, if there is one");
  command->add_option("--request-id", args->request_id,
                      "Your own id: the same command with the same id continues one job");
  AddTreatmentOptions(*command, args->treatment);
  const std::string group = "Reconstruction (defaults: those of the service)";
  AddChoice<v1::Method>(*command, "--method", args->method,
                        {{"litags", v1::METHOD_LITA_GS}, {"3dgs", v1::METHOD_3DGS}})
      ->description("litags or 3dgs")
      ->group(group);
  AddChoice<v1::Tone>(*command, "--tone", args->tone,
                      {{"capture", v1::TONE_CAPTURE},
                       {"linear-gain", v1::TONE_LINEAR_GAIN},
                       {"paper", v1::TONE_PAPER},
                       {"none", v1::TONE_NONE}})
      ->description("Target of the light: capture, linear-gain, paper or none")
      ->group(group);
  AddChoice<v1::WhiteBalance>(
      *command, "--white-balance", args->white_balance,
      {{"camera", v1::WHITE_BALANCE_CAMERA}, {"scene", v1::WHITE_BALANCE_SCENE}})
      ->description("Colour of the light: scene neutralises a strong cast, camera keeps it")
      ->group(group);
  command->add_option("--theta", args->theta, "Mean level of the target, (0, 1); 0: 0.49")
      ->group(group);
  command->add_option("--contrast", args->contrast, "That --tone capture adds, [0, 1]")
      ->group(group);
  command
      ->add_option("--chroma-smoothing", args->chroma_smoothing,
                   "Average colours of dark photos over neighbours alike up to so many "
                   "deviations of the noise; 0: never")
      ->group(group);
  command->add_option("--iterations", args->iterations, "Training iterations")->group(group);
  command
      ->add_option("--schedule-iterations", args->schedule_iterations,
                   "Lay out learning rates and densities for so many; the rest goes on at the last")
      ->group(group);
  command->add_option("--seed", args->seed, "Seed of every random choice")->group(group);
  command->add_option("--threads", args->threads, "Threads; 0: all cores")->group(group);
  command->add_option("--max-gaussians", args->max_gaussians, "Most Gaussians")->group(group);
  AddChoice<v1::DensityStatistic>(*command, "--density-statistic", args->density_statistic,
                                  {{"mean", v1::DENSITY_STATISTIC_MEAN},
                                   {"abs", v1::DENSITY_STATISTIC_ABS},
                                   {"pixel", v1::DENSITY_STATISTIC_PIXEL}})
      ->description("Gradient that lets Gaussians split: mean, abs (AbsGS) or pixel (Pixel-GS)")
      ->group(group);
  AddChoice<v1::DensityGrowth>(*command, "--density-growth", args->density_growth,
                               {{"long-axis", v1::DENSITY_GROWTH_LONG_AXIS},
                                {"clone-split", v1::DENSITY_GROWTH_CLONE_SPLIT}})
      ->description(
          "Gaussians that split become: long-axis, halves side by side, or clone-split, as 3DGS "
          "has it")
      ->group(group);
  command->add_option("--sh-degree", args->sh_degree, "Spherical harmonics, 0..3")->group(group);
  command
      ->add_flag("--no-dense-start", args->no_dense_start,
                 "Start from the sparse points alone, not from stereo's, too")
      ->group(group);
  command
      ->add_option("--settle-epochs", args->settle_epochs,
                   "Rounds over all photos after which learning rates are half; 0: constant")
      ->group(group);
  command
      ->add_option("--dropout", args->dropout,
                   "Share of the scene that an iteration leaves out, after many rounds over noisy "
                   "photos; 0: none")
      ->group(group);
  command
      ->add_flag("--no-information-weights", args->no_information_weights,
                 "Photos of other exposure that know a place better do not count for more")
      ->group(group);
  command
      ->add_flag("--pdm,!--no-pdm", args->use_pdm,
                 "With the paper's denoising module; without by default")
      ->group(group);
  command
      ->add_flag("--no-noise-filter", args->no_noise_filter,
                 "Pictures are not smoothed where they show no more than the photos' noise and "
                 "rounding explain")
      ->group(group);
  command
      ->add_flag("--no-antialiasing", args->no_antialiasing,
                 "Gaussians smaller than a pixel grow, as 3DGS has it: smaller views look thicker")
      ->group(group);
  command->add_option("--pdm-hidden", args->pdm_hidden, "Channels inside its network")
      ->group(group);
  command->add_option("--pdm-every", args->pdm_every, "One iteration in so many denoises")
      ->group(group);
  command
      ->add_option("--exposure-ssim", args->exposure_ssim, "Share of 1 - SSIM in the exposure loss")
      ->group(group);
  command
      ->add_option("--coarse-levels", args->coarse_levels, "Start on photos of 2^-n of their size")
      ->group(group);
  command->add_option("--coarse-until", args->coarse_until, "Part of the run on smaller photos")
      ->group(group);
  command->add_flag("--no-prior", args->no_prior, "Without the structure prior")->group(group);
  command
      ->add_flag(
          "--prior-geometry", args->prior_geometry,
          "The structure prior moves Gaussians, as in the paper; else it trains its map alone")
      ->group(group);
  command->add_flag("--no-depth", args->no_depth, "Without the depth loss")->group(group);
  AddChoice<v1::DepthSource>(*command, "--depth-source", args->depth_source,
                             {{"auto", v1::DEPTH_SOURCE_AUTO},
                              {"maps", v1::DEPTH_SOURCE_MAPS},
                              {"stereo", v1::DEPTH_SOURCE_STEREO},
                              {"network", v1::DEPTH_SOURCE_NETWORK},
                              {"none", v1::DEPTH_SOURCE_NONE}})
      ->description(
          "Depth maps: maps (--depth), stereo of all photos, network (the service's), none, or "
          "auto: "
          "maps if given, else stereo of up to 32 photos")
      ->group(group);
  command->add_option("--depth-weight", args->depth_weight, "Of the depth loss")->group(group);
  command
      ->add_option("--depth-geometry", args->depth_geometry,
                   "true: the depth loss moves Gaussians; false: it sees an attribute of theirs")
      ->group(group);
  command
      ->add_option("--max-image-side", args->max_image_side,
                   "Shrink larger photos to this, px; 0: never")
      ->group(group);
  command->add_option("--holdout-every", args->holdout_every, "Every n-th photo only measures")
      ->group(group);
  command->add_option("--min-registered", args->min_registered, "Share of photos to place, (0, 1]")
      ->group(group);
  command->add_option("--checkpoint-every", args->checkpoint_every, "Iterations")->group(group);
  command->add_option("--preview-every", args->preview_every, "Iterations between snapshots")
      ->group(group);
  command->callback([&session, args] { session.exit_code = Submit(session, *args); });
}

}  // namespace litags::client
