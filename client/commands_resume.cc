// litags resume: a job goes on, perhaps with other options.
#include <memory>
#include <string>

#include "absl/strings/str_cat.h"
#include "client/cli.h"
#include "client/option_flags.h"
#include "client/report/text.h"
#include "client/treatment.h"

namespace litags::client {
namespace {

struct ResumeArgs {
  std::string job;
  v1::JobOptions options;
  Treatment treatment;
};

int Resume(Session& session, const ResumeArgs& args) {
  v1::ResumeJobRequest request;
  request.set_name(args.job);
  *request.mutable_options() = args.options;
  *request.mutable_policy() = ToProto(args.treatment);
  const auto job = session.client().ResumeJob(request);
  if (!job.ok()) return ReportError(session, job.status(), args.job);
  Note(absl::StrCat(args.job, " is ", report::StateText(job->state()),
                    "; follow it with: litags watch ", args.job, " --after ", job->last_event()));
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
  AddOptionFlags(*command, args->options, "Options",
                 {"iterations", "threads", "min_registered", "checkpoint_every", "preview_every"});
  AddTreatmentOptions(*command, args->treatment);
  command->callback([&session, args] { session.exit_code = Resume(session, *args); });
}

}  // namespace litags::client
