// litags list, show, cancel, delete.
#include <google/protobuf/util/json_util.h>

#include <algorithm>
#include <cstdio>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "client/cli.h"
#include "client/report/report.h"
#include "client/report/settings.h"
#include "client/report/text.h"
#include "client/text.h"
#include "proto/arguments/arguments.h"

namespace litags::client {
namespace {

constexpr int kMostListed = 1'000'000;  // by --limit

std::string PhotosText(const v1::Job& job) {
  return report::IsOfVideo(job) ? "video" : absl::StrCat(job.photos());
}

// How far a job is, in a few words.
std::string At(const v1::Job& job) {
  if (job.state() == v1::JOB_STATE_UPLOADING) return report::BytesText(job.bytes());
  if (job.state() == v1::JOB_STATE_SUCCEEDED) {
    return absl::StrCat(report::CountText(job.report().gaussians()), " Gaussians");
  }
  if (job.progress().iterations() == 0) {
    return job.has_progress() ? report::StageText(job.progress().stage()) : "";
  }
  return absl::StrCat(job.progress().iteration(), "/", job.progress().iterations());
}

int List(Session& session, v1::ListJobsRequest request, int limit, bool json) {
  int printed = 0;
  do {
    request.set_page_size(limit > 0 ? std::min(limit - printed, 1000) : 200);
    const auto page = session.client().ListJobs(request);
    if (!page.ok()) return ReportError(session, page.status());
    for (const v1::Job& job : page->jobs()) {
      if (json) {
        PrintJson(job, /*pretty=*/false);
      } else {
        if (printed == 0) {
          std::printf("%-30s %-10s %-19s %6s  %-18s %s\n", "JOB", "STATE", "CREATED (UTC)",
                      "PHOTOS", "AT", "NAME");
        }
        std::printf("%-30s %-10s %-19s %6s  %-18s %s\n", report::Printable(job.name()).c_str(),
                    report::StateText(job.state()).c_str(),
                    report::TimeText(job.create_time()).c_str(), PhotosText(job).c_str(),
                    At(job).c_str(), report::Printable(job.display_name()).c_str());
      }
      ++printed;
    }
    request.set_page_token(page->next_page_token());
  } while (!request.page_token().empty() && (limit == 0 || printed < limit));
  if (printed == 0 && !json) {
    Note(request.filter().empty() ? "no jobs yet; make one with: litags submit DIR"
                                  : "no job passes the filter");
  }
  return kExitOk;
}

// "method=litags tone=capture iterations=10000 ...", the values as the command line takes them.
std::string OptionsText(const v1::JobOptions& options) {
  std::vector<std::string> texts;
  const auto& fields = *v1::JobOptions::descriptor();
  for (int i = 0; i < fields.field_count(); ++i) {
    if (!options.GetReflection()->HasField(options, fields.field(i))) continue;
    const std::string& name = fields.field(i)->name();
    texts.push_back(absl::StrCat(name, "=", report::OptionText(options, name)));
  }
  return absl::StrJoin(texts, " ");
}

void PrintJob(const v1::Job& job) {
  const auto row = [](const char* name, const std::string& value) {
    if (!value.empty()) std::printf("%-10s %s\n", name, report::Printable(value).c_str());
  };
  row("job", job.name());
  row("name", job.display_name());
  row("state",
      report::StateText(job.state()) + (job.cancel_requested() ? " (cancel requested)" : ""));
  if (job.queue_position() > 0) row("in queue", absl::StrCat("number ", job.queue_position()));
  row("waits for", job.waits_for());
  row("owner", job.owner());
  row("labels", report::LabelsText(job));
  row("photos", absl::StrCat(PhotosText(job), " (", report::BytesText(job.bytes()), ")"));
  row("created", report::TimeText(job.create_time()));
  row("started", report::TimeText(job.start_time()));
  row("ended", report::TimeText(job.end_time()));
  row("attempt", absl::StrCat(job.attempt()));
  row("events", absl::StrCat(job.last_event()));
  if (job.has_snapshot_iteration()) {
    row("snapshot", absl::StrCat("iteration ", job.snapshot_iteration()));
  }
  if (job.has_progress()) row("progress", ProgressLine(job.progress(), 200));
  row("options", OptionsText(job.options()));
  if (report::HasEnded(job.state())) {
    std::printf("%s", OutcomeText(job).c_str());
  }
}

// A command that takes a job and nothing else.
void AddSimpleCommand(CLI::App& app, Session& session, const std::string& name,
                      const std::string& description,
                      std::function<int(const std::string& job)> run) {
  auto job = std::make_shared<std::string>();
  CLI::App* command = app.add_subcommand(name, description);
  AddJobArgument(*command, *job);
  command->callback([&session, job, run = std::move(run)] { session.exit_code = run(*job); });
}

void AddListAndShow(CLI::App& app, Session& session) {
  struct Args {
    std::string job;
    int limit = 0;
    bool json = false, oldest_first = false;
    v1::ListJobsRequest request;
  };
  auto args = std::make_shared<Args>();
  CLI::App* list = app.add_subcommand("list", "All jobs, newest first");
  list->add_option("--limit", args->limit, "At most this many; 0: all")
      ->check(Between(0, kMostListed));
  list->add_option("--filter", *args->request.mutable_filter(),
                   "Only these, as 'state = FAILED AND labels.site = north' (AIP-160: OR binds "
                   "tighter than AND; fields: state, name, display_name, owner, policy.priority, "
                   "labels.KEY, create_time, start_time, end_time)");
  list->add_flag("--oldest-first", args->oldest_first, "The other way round");
  list->add_flag("--json", args->json, "One JSON object per line");
  list->callback([&session, args] {
    if (args->oldest_first) args->request.set_order_by("create_time");
    session.exit_code = List(session, args->request, args->limit, args->json);
  });

  CLI::App* show = app.add_subcommand("show", "One job: state, options, progress, outcome");
  AddJobArgument(*show, args->job);
  show->add_flag("--json", args->json, "As JSON");
  show->callback([&session, args] {
    const auto job = session.client().GetJob(args->job);
    if (!job.ok()) {
      session.exit_code = ReportError(session, job.status(), args->job);
    } else if (args->json) {
      PrintJson(*job, /*pretty=*/true);
    } else {
      PrintJob(*job);
    }
  });
}

void AddDelete(CLI::App& app, Session& session) {
  auto jobs = std::make_shared<std::vector<std::string>>();
  CLI::App* command = app.add_subcommand("delete", "Remove jobs with their photos and scenes");
  command->add_option("JOB", *jobs, "Ids of jobs, or jobs/ID")->required();
  command->callback([&session, jobs] {
    for (const std::string& job : *jobs) {
      const std::string name = JobName(job);
      const absl::Status status = session.client().DeleteJob(name);
      if (status.ok()) {
        Note(absl::StrCat(name, " is deleted"));
      } else {
        session.exit_code = ReportError(session, status, name);
      }
    }
  });
}

}  // namespace

void PrintJson(const google::protobuf::Message& message, bool pretty, std::FILE* out) {
  google::protobuf::util::JsonPrintOptions options;
  options.add_whitespace = pretty;
  std::string text;
  (void)google::protobuf::util::MessageToJsonString(message, &text, options);
  std::fprintf(out, "%s%s", text.c_str(), pretty ? "" : "\n");
}

void AddJobCommands(CLI::App& app, Session& session) {
  AddListAndShow(app, session);
  AddSimpleCommand(
      app, session, "cancel", "Stop a job; what it has learnt is kept, and resume goes on with it",
      [&session](const std::string& name) -> int {
        const auto job = session.client().CancelJob(name);
        if (!job.ok()) return ReportError(session, job.status(), name);
        Note(absl::StrCat(
            name, job->state() == v1::JOB_STATE_CANCELLED ? " is cancelled" : " is stopping",
            "; continue it with: litags resume ", name));
        return kExitOk;
      });
  AddDelete(app, session);
}

}  // namespace litags::client
