// litags info, files, log, update, clone.
#include <algorithm>
#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "client/cli.h"
#include "client/job_files.h"
#include "client/labels.h"
#include "client/option_flags.h"
#include "client/report/settings.h"
#include "client/report/text.h"
#include "client/treatment.h"
#include "proto/arguments/arguments.h"

namespace litags::client {
namespace {

using report::BytesText;
using report::CountText;
using report::Printable;

void Row(const std::string& name, const std::string& value) {
  std::printf("%-22s %s\n", name.c_str(), Printable(value).c_str());
}

// "3 of 1,000", or "3" where there is no limit.
std::string UseText(const std::string& used, const std::string& limit, bool limited) {
  return limited ? absl::StrCat(used, " of ", limit) : used;
}

std::string RangeText(const v1::OptionInfo& option) {
  if (option.choices_size() > 0) return absl::StrJoin(option.choices(), " | ");
  std::string text;
  if (option.has_minimum() && option.has_maximum()) {
    text = absl::StrFormat("%s%.10g..%s%.10g", option.minimum_excluded() ? "above " : "",
                           option.minimum(), option.maximum_excluded() ? "below " : "",
                           option.maximum());
  } else if (option.has_minimum()) {
    text =
        absl::StrFormat("%s %.10g", option.minimum_excluded() ? "above" : "from", option.minimum());
  }
  if (!option.zero_means().empty()) {
    absl::StrAppend(&text, text.empty() ? "" : ", ", "0: ", option.zero_means());
  }
  return text;
}

// Those of the method that a job gets which names none.
v1::JobOptions DefaultsOf(const v1::ServerInfo& info) {
  for (const v1::MethodInfo& method : info.methods()) {
    if (method.method() == v1::METHOD_LITAGS) return method.defaults();
  }
  return {};
}

int Info(Session& session, bool json) {
  const auto info = session.client().GetServerInfo();
  if (!info.ok()) return ReportError(session, info.status());
  if (json) {
    PrintJson(*info, /*pretty=*/true);
    return kExitOk;
  }
  const v1::ClientUse& use = info->client();
  Row("version", info->version());
  Row("you are", absl::StrCat(use.name().empty() ? "nobody by name" : use.name(),
                              use.admin() && !use.name().empty() ? ", an administrator" : ""));
  Row("your jobs", UseText(CountText(use.jobs()), CountText(use.max_jobs()), use.max_jobs() > 0));
  Row("your bytes",
      UseText(BytesText(use.bytes()), BytesText(use.max_bytes()), use.max_bytes() > 0));
  Row("workers",
      absl::StrCat(info->workers(), info->depth_network() ? ", with a depth network" : ""));
  const v1::JobLimits& limits = info->job_limits();
  Row("a job's files",
      absl::StrCat("at most ", CountText(limits.max_files()), ", ",
                   BytesText(limits.max_job_bytes()), " together, ",
                   BytesText(limits.max_file_bytes()), " a photo, mask or depth map"));
  Row("its photos", absl::StrCat("at least ", limits.min_photos(), ", at most ",
                                 CountText(limits.max_photo_pixels()), " pixels each"));
  if (limits.max_iterations() > 0) Row("its iterations", CountText(limits.max_iterations()));
  if (limits.max_gaussians() > 0) Row("its Gaussians", CountText(limits.max_gaussians()));
  if (limits.has_max_run_time()) {
    Row("its run time", report::DurationText(report::SecondsOf(limits.max_run_time())));
  }
  const v1::JobOptions defaults = DefaultsOf(*info);
  size_t widest = 5;  // RANGE
  for (const v1::OptionInfo& option : info->options()) {
    widest = std::max(widest, report::ColumnsOf(Printable(RangeText(option))));
  }
  constexpr char kOption[] = "  %-20s %-9s %s %s\n";
  std::printf("\noptions of a job:\n");
  std::printf(kOption, "NAME", "DEFAULT", report::Padded("RANGE", widest).c_str(), "MEANING");
  for (const v1::OptionInfo& option : info->options()) {
    std::printf(kOption, Printable(option.name()).c_str(),
                report::OptionText(defaults, option.name()).c_str(),
                report::Padded(Printable(RangeText(option)), widest).c_str(),
                Printable(option.help()).c_str());
  }
  return kExitOk;
}

int Files(Session& session, const std::string& job) {
  const auto files = ListAllFiles(session.client(), job);
  if (!files.ok()) return ReportError(session, files.status(), job);
  std::printf("%s", FileTable(*files).c_str());
  return kExitOk;
}

int Log(Session& session, const std::string& job, int64_t after, bool follow) {
  const absl::Status status =
      session.client().GetLog(job, after, follow, [](const v1::LogEntry& entry) {
        const char* mark = entry.severity() == v1::LOG_SEVERITY_ERROR     ? "ERROR "
                           : entry.severity() == v1::LOG_SEVERITY_WARNING ? "note: "
                                                                          : "";
        std::printf("%s  %s%s\n", report::TimeText(entry.time()).c_str(), mark,
                    Printable(entry.text()).c_str());
        std::fflush(stdout);
      });
  return status.ok() ? kExitOk : ReportError(session, status, job);
}

struct UpdateArgs {
  std::string job;
  std::optional<std::string> name;
  std::vector<std::string> labels, removed;
  std::optional<int> priority;
  std::optional<double> keep_seconds;
  std::optional<std::string> worker_labels;
};

int Update(Session& session, const UpdateArgs& args) {
  v1::UpdateJobRequest request;
  v1::Job& job = *request.mutable_job();
  google::protobuf::FieldMask& mask = *request.mutable_update_mask();
  job.set_name(args.job);
  if (args.name) {
    job.set_display_name(*args.name);
    mask.add_paths("display_name");
  }
  if (!ParseLabels(args.labels, job.mutable_labels())) return kExitBadInput;
  for (const auto& [key, value] : job.labels()) mask.add_paths("labels." + key);
  for (const std::string& key : args.removed) {
    if (job.labels().contains(key)) {
      Note(absl::StrCat("--remove-label ", key, " beside --label ", key, "=...; leave one out"));
      return kExitBadInput;
    }
    mask.add_paths("labels." + key);
  }
  if (args.priority) {
    job.mutable_policy()->set_priority(*args.priority);
    mask.add_paths("policy.priority");
  }
  if (args.keep_seconds) {
    *job.mutable_policy()->mutable_retention() = DurationOf(*args.keep_seconds);
    mask.add_paths("policy.retention");
  }
  if (args.worker_labels) {
    for (const absl::string_view label :
         absl::StrSplit(*args.worker_labels, ',', absl::SkipEmpty())) {
      job.mutable_policy()->add_worker_labels(std::string(label));
    }
    mask.add_paths("policy.worker_labels");
  }
  if (mask.paths().empty()) {
    Note("nothing to change; see litags update --help");
    return kExitBadInput;
  }
  const auto changed = session.client().UpdateJob(request);
  if (!changed.ok()) return ReportError(session, changed.status(), args.job);
  Note(absl::StrCat(args.job, " is changed"));
  return kExitOk;
}

struct CloneArgs {
  std::string job, name;
  std::vector<std::string> labels;
  v1::JobOptions options;
  Treatment treatment;
};

// Options that would have no effect on a clone are mistakes; those of its source are not.
absl::Status CheckOptionsAreUsed(Session& session, const CloneArgs& args) {
  if (args.options.frames() != 0) {
    const auto files = ListAllFiles(session.client(), args.job);
    if (!files.ok()) return files.status();
    const absl::Status used = CheckFramesAreOfVideo(
        args.options, std::any_of(files->begin(), files->end(), [](const v1::JobFile& file) {
          return file.role() == v1::FILE_ROLE_VIDEO;
        }));
    if (!used.ok()) return used;
  }
  if (args.options.depth_source() == v1::DEPTH_SOURCE_UNSPECIFIED &&
      args.options.white_balance() == v1::WHITE_BALANCE_UNSPECIFIED) {
    return absl::OkStatus();
  }
  const auto source = session.client().GetJob(args.job);
  if (!source.ok()) return source.status();
  const v1::JobOptions& before = source->options();
  v1::JobOptions options = args.options;
  if (options.method() == v1::METHOD_UNSPECIFIED) options.set_method(before.method());
  // Another method has a tone of its own.
  if (options.tone() == v1::TONE_UNSPECIFIED && options.method() == before.method()) {
    options.set_tone(before.tone());
  }
  return CheckMethodUses(options);
}

int Clone(Session& session, const CloneArgs& args) {
  const absl::Status used = CheckOptionsAreUsed(session, args);
  if (!used.ok()) return ReportError(session, used, args.job);
  v1::CloneJobRequest request;
  request.set_name(args.job);
  request.set_display_name(args.name);
  if (!ParseLabels(args.labels, request.mutable_labels())) return kExitBadInput;
  *request.mutable_options() = args.options;
  *request.mutable_policy() = ToProto(args.treatment);
  const auto clone = session.client().CloneJob(request);
  if (!clone.ok()) return ReportError(session, clone.status(), args.job);
  const auto started = session.client().StartJob(clone->name());
  if (!started.ok()) {
    const int exit_code = ReportError(session, started.status(), clone->name());
    if (MayHaveStarted(started.status())) {
      NoteMayHaveStarted(clone->name());
    } else {
      RemoveUnstarted(session, clone->name(), started.status());
    }
    return exit_code;
  }
  std::printf("%s\n", clone->name().c_str());
  std::fflush(stdout);
  Note(absl::StrCat("follow it with: litags watch ", clone->name()));
  return kExitOk;
}

void AddUpdate(CLI::App& app, Session& session) {
  auto args = std::make_shared<UpdateArgs>();
  CLI::App* command =
      app.add_subcommand("update", "Change a job's title, labels, priority, end or worker");
  AddJobArgument(*command, args->job);
  command->add_option("--name", args->name, "Title for humans");
  AddLabelOption(*command, args->labels);
  command->add_option("--remove-label", args->removed, "Key of a label to take away; repeatable")
      ->allow_extra_args(false);
  command->add_option("--priority", args->priority,
                      "Priority in the queue, -100..100: the highest first");
  command
      ->add_option("--keep-seconds", args->keep_seconds,
                   "Remove the job so long after its end; 0: never")
      ->check(AtLeastZero(0.0));
  command->add_option("--worker-labels", args->worker_labels,
                      "Labels its worker must have, as avx512,site-b; \"\": none");
  command->callback([&session, args] { session.exit_code = Update(session, *args); });
}

void AddClone(CLI::App& app, Session& session) {
  auto args = std::make_shared<CloneArgs>();
  CLI::App* command = app.add_subcommand(
      "clone", "Start a new job with another one's photos and other options; prints its name");
  AddJobArgument(*command, args->job);
  command->add_option("--name", args->name, "Title for humans");
  AddLabelOption(*command, args->labels);
  AddTreatmentOptions(*command, args->treatment);
  AddOptionFlags(*command, args->options, "Reconstruction (defaults: those of the other job)");
  command->callback([&session, args] { session.exit_code = Clone(session, *args); });
}

}  // namespace

void AddManageCommands(CLI::App& app, Session& session) {
  struct Args {
    std::string job;
    int64_t after = 0;
    bool follow = false, json = false;
  };
  auto args = std::make_shared<Args>();
  CLI::App* info = app.add_subcommand("info", "What the server is and allows, and what you use");
  info->add_flag("--json", args->json, "As JSON");
  info->callback([&session, args] { session.exit_code = Info(session, args->json); });

  CLI::App* files = app.add_subcommand("files", "The files of a job");
  AddJobArgument(*files, args->job);
  files->callback([&session, args] { session.exit_code = Files(session, args->job); });

  CLI::App* log = app.add_subcommand("log", "A job's log: runs, COLMAP's words, notes, errors");
  AddJobArgument(*log, args->job);
  log->add_flag("--follow", args->follow, "Then print what comes, until the job ends");
  log->add_option("--after", args->after, "Only entries after this number");
  log->callback(
      [&session, args] { session.exit_code = Log(session, args->job, args->after, args->follow); });
  AddUpdate(app, session);
  AddClone(app, session);
}

}  // namespace litags::client
