// litags report: what came of a job, as one HTML file.
#include <filesystem>
#include <memory>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "client/cli.h"
#include "client/picture_file.h"
#include "client/report/report.h"
#include "client/report/text.h"
#include "client/status.h"
#include "google/protobuf/util/time_util.h"

namespace litags::client {
namespace {

absl::Status AddScene(Client& client, report::ReportData* data) {
  auto cameras = client.ListCameras(data->job.name());
  if (!cameras.ok()) return cameras.status();
  data->cameras = *std::move(cameras);
  data->pictures = report::PicturesOf(data->job, data->cameras);
  for (report::Picture& picture : data->pictures) {
    auto view = client.RenderView(picture.request);
    if (!view.ok()) return view.status();
    picture.view = *std::move(view);
  }
  return absl::OkStatus();
}

absl::StatusOr<report::ReportData> Gather(Client& client, const std::string& name) {
  report::ReportData data;
  auto job = client.GetJob(name);
  if (!job.ok()) return job.status();
  data.job = *std::move(job);
  auto server = client.GetServerInfo();
  if (!server.ok()) return server.status();
  data.server = *std::move(server);
  absl::Status status = client.ListEvents(
      name, data.job.last_event(), [&](const v1::JobEvent& event) { data.course.Add(event); });
  if (status.ok() && report::HasScene(data.job)) status = AddScene(client, &data);
  if (!status.ok()) return status;
  data.made = google::protobuf::util::TimeUtil::GetCurrentTime();
  return data;
}

absl::Status CheckOutput(const std::string& output) {
  const std::string ending = std::filesystem::path(output).extension();
  if (absl::EqualsIgnoreCase(ending, ".html") || absl::EqualsIgnoreCase(ending, ".htm")) {
    return absl::OkStatus();
  }
  return BadInput("REPORT_FORMAT_UNKNOWN", "-o",
                  absl::StrCat(output, ": a report is HTML; end the name with .html"));
}

int Report(Session& session, const std::string& job, const std::string& output) {
  if (const absl::Status status = CheckOutput(output); !status.ok()) {
    return ReportError(session, status, job);
  }
  OutputFile file;  // opened before the server renders for it
  absl::Status status = file.Open(output);
  if (!status.ok()) return ReportError(session, status, job);
  const auto data = Gather(session.client(), job);
  if (!data.ok()) return ReportError(session, data.status(), job);
  const std::string page = report::ReportHtml(*data);
  status = file.Write(page);
  if (status.ok()) status = file.Commit();
  if (!status.ok()) return ReportError(session, status, job);
  Note(absl::StrCat(output, ": ", report::BytesText(static_cast<int64_t>(page.size()))));
  return kExitOk;
}

}  // namespace

void AddReportCommand(CLI::App& app, Session& session) {
  struct Args {
    std::string job, output;
  };
  auto args = std::make_shared<Args>();
  CLI::App* command = app.add_subcommand(
      "report",
      "What came of a job as one HTML file: settings, cameras, quality, curves, pictures, notes");
  AddJobArgument(*command, args->job);
  command->add_option("-o,--output", args->output, "File, as report.html")->required();
  command->callback(
      [&session, args] { session.exit_code = Report(session, args->job, args->output); });
}

}  // namespace litags::client
