// litags submit: a folder of photos becomes a job.
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <optional>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "client/cli.h"
#include "client/job_files.h"
#include "client/labels.h"
#include "client/option_flags.h"
#include "client/report/text.h"
#include "client/status.h"
#include "client/treatment.h"
#include "client/upload.h"

namespace litags::client {
namespace {

struct SubmitArgs {
  std::string dir, cameras, depth_dir, masks_dir, request_id;
  std::optional<std::string> name;
  std::string webhook, webhook_secret;
  std::vector<std::string> labels;
  bool watch = false, strict = false;
  v1::JobOptions options;
  Treatment treatment;
};

// The first few of `total` names.
std::string ShortList(std::vector<std::string> names, size_t total) {
  constexpr size_t kShown = 5;
  names.resize(std::min(names.size(), kShown));
  for (std::string& name : names) name = report::PrintableLine(name);
  const size_t more = total - names.size();
  return absl::StrCat(absl::StrJoin(names, ", "),
                      more > 0 ? absl::StrCat(" and ", more, " more") : "");
}

void NoteSkipped(const Capture& capture) {
  if (capture.skipped.empty()) return;
  Note(absl::StrCat(
      "not sent, since the names are not those of photos: ",
      ShortList(capture.skipped, capture.skipped.size()),
      capture.files.back().role == v1::FILE_ROLE_PHOTO
          ? " (known cameras go with --cameras, depth maps with --depth, masks with --masks)"
          : ""));
}

void NoteMasks(const Capture& capture) {
  if (capture.masks_dir.empty()) return;
  const auto masks =
      std::count_if(capture.files.begin(), capture.files.end(),
                    [](const LocalFile& file) { return file.role == v1::FILE_ROLE_MASK; });
  Note(absl::StrCat("with ", report::Counted(masks, "mask"), " from ", capture.masks_dir,
                    ": what is 0 there is not learnt"));
}

// Drawn anew on a terminal; elsewhere it would be a line for every photo.
void NoteReading(const LocalFile& file) {
  if (isatty(STDERR_FILENO) == 0) return;
  std::fprintf(stderr, "\rreading %s\x1b[K", report::Printable(file.name).c_str());
  std::fflush(stderr);
}

// The upload's progress: drawn anew on a terminal, else said at the end only. `*told` counts those
// left out that were named: at once, since the upload may fail later.
void NoteUpload(const UploadProgress& progress, size_t* told) {
  const std::string text = absl::StrCat("uploaded ", progress.files_done, "/", progress.files,
                                        " files, ", report::BytesText(progress.bytes_done), " of ",
                                        report::BytesText(progress.bytes));
  const bool done = progress.files_done == progress.files;
  if (done && !progress.skipped.empty()) {
    Note(absl::StrCat("not used, of what is in the archive: ",
                      ShortList(progress.skipped, progress.skipped_total)));
  }
  for (; *told < progress.left_out.size(); ++*told) Note(progress.left_out[*told]);
  if (isatty(STDERR_FILENO)) {
    std::fprintf(stderr, "\r%s\x1b[K%s", text.c_str(), done ? "\n" : "");
    std::fflush(stderr);
  } else if (done) {
    Note(text);
  }
}

// What becomes of a job whose submission failed: one that may run stays, one whose server is gone
// or busy is continued, others are removed unless the user named their request. `starting`: it was
// the start that failed.
void CleanUp(Session& session, const SubmitArgs& args, const std::string& request_id,
             const std::string& job, const absl::Status& why, bool starting) {
  if (starting && MayHaveStarted(why)) {
    NoteMayHaveStarted(job);
    Note(absl::StrCat("if it was not, start it with the same command",
                      args.request_id.empty() ? " and --request-id " + request_id : ""));
    return;
  }
  if (!args.request_id.empty()) {
    Note(absl::StrCat(job, " is kept; the same command continues the upload"));
    return;
  }
  if (!absl::IsCancelled(why) && MayBeTriedAgain(why)) {
    Note(absl::StrCat(job,
                      " was not started and is still there; continue it with the same command "
                      "and --request-id ",
                      request_id, ", or remove it with: litags delete ", job));
    return;
  }
  RemoveUnstarted(session, job, why);
}

absl::Status UploadAndStart(Session& session, const std::string& job, Capture& capture, bool strict,
                            bool* starting) {
  size_t told = 0;
  const auto note = [&told](const UploadProgress& progress) { NoteUpload(progress, &told); };
  absl::Status status = UploadFiles(session.client(), job, capture.files, note, strict);
  if (!status.ok()) return status;
  const auto sent = ListAllFiles(session.client(), job);
  if (!sent.ok()) return sent.status();
  for (const std::string& line : DescribeFiles(*sent)) Note(line);
  *starting = true;
  return session.client().StartJob(job).status();
}

// Options that would have no effect are mistakes. Depth maps of a dataset's folder, which nobody
// named, may stay unused.
absl::Status CheckOptionsAreUsed(const SubmitArgs& args, const Capture& capture) {
  const v1::DepthSource source = args.options.depth_source();
  const bool maps = source == v1::DEPTH_SOURCE_UNSPECIFIED || source == v1::DEPTH_SOURCE_AUTO ||
                    source == v1::DEPTH_SOURCE_MAPS;
  if (!args.depth_dir.empty() && (!maps || args.options.method() == v1::METHOD_3DGS)) {
    return BadInput("OPTION_UNUSED", "--depth",
                    "--depth: the maps would not be used; leave it out, or take --depth-source "
                    "maps and another method than 3dgs");
  }
  if (absl::Status used = CheckMethodUses(args.options); !used.ok()) return used;
  return CheckFramesAreOfVideo(args.options, std::any_of(capture.files.begin(), capture.files.end(),
                                                         [](const LocalFile& file) {
                                                           return file.role == v1::FILE_ROLE_VIDEO;
                                                         }));
}

void SetWebhook(const SubmitArgs& args, v1::Webhook* webhook) {
  webhook->set_url(args.webhook);
  // The variable may be set for all commands of a shell, those without a webhook, too: it is no
  // envname() of the option, which needs --webhook.
  const char* secret = std::getenv("LITAGS_WEBHOOK_SECRET");
  webhook->set_secret(args.webhook_secret.empty() && secret ? secret : args.webhook_secret);
}

int Submit(Session& session, const SubmitArgs& args) {
  auto capture = ScanCapture(args.dir, args.cameras, args.depth_dir, args.masks_dir);
  if (!capture.ok()) return ReportError(session, capture.status());
  const absl::Status used = CheckOptionsAreUsed(args, *capture);
  if (!used.ok()) return ReportError(session, used);
  NoteSkipped(*capture);
  NoteMasks(*capture);
  for (const std::string& note : capture->notes) Note(note);

  v1::CreateJobRequest request;
  request.set_display_name(args.name.value_or(DefaultTitle(args.dir)));
  request.set_request_id(args.request_id.empty() ? RandomId() : args.request_id);
  if (!ParseLabels(args.labels, request.mutable_labels())) return kExitBadInput;
  *request.mutable_options() = args.options;
  *request.mutable_policy() = ToProto(args.treatment);
  if (!args.webhook.empty()) SetWebhook(args, request.mutable_webhook());
  const auto left_out = ReadFiles(capture->files, session.interrupt, NoteReading, args.strict);
  if (!left_out.ok()) return ReportError(session, left_out.status());
  for (const std::string& line : *left_out) Note(line);
  auto digest = ContentDigest(capture->files, session.interrupt, [](const LocalFile&) {});
  if (!digest.ok()) return ReportError(session, digest.status());
  request.set_content_digest(*std::move(digest));
  const auto job = session.client().CreateJob(request);
  if (!job.ok()) return ReportError(session, job.status());

  if (job->state() == v1::JOB_STATE_UPLOADING) {
    bool starting = false;
    const absl::Status status =
        UploadAndStart(session, job->name(), *capture, args.strict, &starting);
    if (!status.ok()) {
      const int exit_code = ReportError(session, status, job->name());
      CleanUp(session, args, request.request_id(), job->name(), status, starting);
      return exit_code;
    }
  } else {
    Note(absl::StrCat(job->name(), " was submitted before and is ",
                      report::StateText(job->state())));
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
      "submit",
      "Send a folder of photos, or a video, and start its reconstruction; prints the job's name");
  command
      ->add_option("DIR", args->dir,
                   "Folder with the photos (of its subfolders only masks is read), or of a dataset "
                   "(photos in images, cameras beside it), or a .zip, .tar or .tar.gz of one, or a "
                   "video")
      ->required();
  command->add_flag("--watch", args->watch, "Then follow the job until it ends");
  command->add_flag("--strict", args->strict,
                    "Refuse if a photo of the folder cannot be read or sent; else it is left out");
  command->add_option("--name", args->name, "Title for humans; default: the folder's name");
  AddLabelOption(*command, args->labels);
  command->add_option(
      "--cameras", args->cameras,
      "Known cameras: a transforms.json, the folder of a COLMAP model, or a file of "
      "OpenMVG, Meshroom, Metashape or Bundler");
  command->add_option("--depth", args->depth_dir,
                      "Folder with depth maps, named as the photos (.png 16 bit, .pfm, .npy)");
  command->add_option("--masks", args->masks_dir,
                      "Folder with masks of photos, <photo's name>.png, 0 where a pixel is not of "
                      "the scene; default: DIR/masks, if there is one");
  CLI::Option* webhook =
      command->add_option("--webhook", args->webhook,
                          "URL that is told when the job has ended, if the server allows it");
  command
      ->add_option("--webhook-secret", args->webhook_secret,
                   "Key of its signatures, 16 to 128 bytes; LITAGS_WEBHOOK_SECRET may hold it")
      ->needs(webhook);
  command->add_option("--request-id", args->request_id,
                      "Your own id: the same command with the same id continues one job");
  AddTreatmentOptions(*command, args->treatment);
  AddOptionFlags(*command, args->options, "Reconstruction (defaults: those of the service)");
  command->callback([&session, args] { session.exit_code = Submit(session, *args); });
}

}  // namespace litags::client
