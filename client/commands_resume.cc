// litags resume: a job goes on, perhaps with other options.
#include <memory>
#include <optional>
#include <string>

#include "absl/strings/str_cat.h"
#include "client/cli.h"
#include "client/text.h"
#include "client/treatment.h"

namespace litags::client {
namespace {

struct ResumeArgs {
  std::string job;
  std::optional<int> iterations, threads, checkpoint_every, preview_every;
  Treatment treatment;
};

int Resume(Session& session, const ResumeArgs& args) {
  v1::ResumeJobRequest request;
  request.set_name(args.job);
  v1::JobOptions& options = *request.mutable_options();
  if (args.iterations) options.set_iterations(*args.iterations);
  if (args.threads) options.set_threads(*args.threads);
  if (args.checkpoint_every) options.set_checkpoint_every(*args.checkpoint_every);
  if (args.preview_every) options.set_preview_every(*args.preview_every);
  *request.mutable_policy() = ToProto(args.treatment);
  const auto job = session.client().ResumeJob(request);
  if (!job.ok()) return ReportError(session, job.status(), args.job);
  Note(absl::StrCat(args.job, " is ", StateText(job->state()), "; follow it with: litags watch ",
                    args.job, " --after ", job->last_event()));
  return kExitOk;
}

}  // namespace

void AddResumeCommand(CLI::App& app, Session& session) {
  auto args = std::make_shared<ResumeArgs>();
  CLI::App* command = app.add_subcommand("resume",
                                         "Continue a failed or cancelled job from its last "
                                         "checkpoint; with more --iterations, train a "
                                         "finished scene further");
  AddJobArgument(*command, args->job);
  command->add_option("--iterations", args->iterations,
                      "In all; those beyond what the job had go on at its last learning rates");
  command->add_option("--threads", args->threads, "Threads; 0: all cores");
  command->add_option("--checkpoint-every", args->checkpoint_every, "Iterations");
  command->add_option("--preview-every", args->preview_every, "Iterations between snapshots");
  AddTreatmentOptions(*command, args->treatment);
  command->callback([&session, args] { session.exit_code = Resume(session, *args); });
}

}  // namespace litags::client
