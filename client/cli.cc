#include "client/cli.h"

#include <unistd.h>

#include <cstdio>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "client/report/text.h"
#include "client/status.h"

namespace litags::client {
namespace {

// The command that helps, where there is one; the service's messages know no commands.
std::string NextStep(const std::string& reason, const std::string& job) {
  if (reason == "JOB_NOT_FOUND") return "litags list";
  if (reason == "CAMERA_NOT_FOUND") return absl::StrCat("litags cameras ", job);
  if (reason == "SCENE_NOT_READY") return absl::StrCat("litags watch ", job);
  if (reason == "JOB_RUNNING") return absl::StrCat("litags cancel ", job);
  if (reason == "JOB_NOT_RESUMABLE" || reason == "JOB_ALREADY_DONE" ||
      reason == "JOB_NOT_UPLOADING" || reason == "SCENE_NOT_MADE") {
    return absl::StrCat("litags show ", job);
  }
  return "";
}

// What to do where no connection came about, by gRPC's words of why.
std::string Remedy(const std::string& message) {
  if (absl::StrContains(message, "http1.x")) {
    return "that port speaks HTTP, as the page's does (--web of litags-server); name the port of "
           "its --listen";
  }
  if (absl::StrContains(message, "wrong version number")) {
    return "that port does not speak TLS; leave --tls and --tls-ca out";
  }
  if (absl::StrContains(message, "DNS resolution failed")) {
    return "its name has no address; check the spelling of --server or LITAGS_SERVER";
  }
  std::string remedy =
      "start one with \"litags-server\", or name another with --server HOST:PORT or LITAGS_SERVER";
  // A refused connection never came as far as TLS.
  if (!absl::StrContains(message, "refused")) {
    absl::StrAppend(
        &remedy, "; a server that speaks TLS needs --tls or --tls-ca, one that does not neither");
  }
  return remedy;
}

std::string UnreachableText(const Session& session, const absl::Status& status) {
  if (absl::IsDeadlineExceeded(status)) {
    return absl::StrCat("the server at ", session.connection.server,
                        " did not answer in time: is it busy? try again, or look into its log");
  }
  const std::string message(status.message());
  return absl::StrCat("no server answers at ", session.connection.server, ": ", Remedy(message),
                      " (", message, ")");
}

}  // namespace

absl::Status Session::Open() {
  auto channel = Connect(connection);
  if (!channel.ok()) return channel.status();
  ClientOptions options;
  options.retry_seconds = retry_seconds;
  options.on_retry = [](const absl::Status& why, double pause) {
    Note(absl::StrCat("trying again in ", report::DurationText(std::max(1.0, pause)), " (",
                      std::string(why.message()), ")"));
  };
  client_ = std::make_unique<Client>(*std::move(channel), std::move(options), interrupt);
  return absl::OkStatus();
}

int ReportError(const Session& session, const absl::Status& status, const std::string& job) {
  const int exit_code = ExitCodeOf(status);
  const v1::ErrorDetail detail = DetailOf(status);
  if (exit_code == kExitInterrupted) {
    Note("interrupted");
    return exit_code;
  }
  if (exit_code == kExitUnreachable && detail.reason().empty()) {
    Note(absl::StrCat("error: ", UnreachableText(session, status)));
    return exit_code;
  }
  std::string text = absl::StrCat("error: ", std::string(status.message()));
  if (!detail.field().empty()) absl::StrAppend(&text, "\n  field:  ", detail.field());
  absl::StrAppend(&text, "\n  code:   ", absl::StatusCodeToString(status.code()));
  if (!detail.reason().empty()) absl::StrAppend(&text, " ", detail.reason());
  if (const std::string next = NextStep(detail.reason(), job); !next.empty()) {
    absl::StrAppend(&text, "\n  try:    ", next);
  }
  Note(text);
  return exit_code;
}

bool MayHaveStarted(const absl::Status& why) {
  return MayBeTriedAgain(why) || DetailOf(why).reason().empty();
}

void NoteMayHaveStarted(const std::string& job) {
  Note(absl::StrCat(job, " may have been started; see: litags show ", job));
}

void RemoveUnstarted(Session& session, const std::string& job, const absl::Status& why) {
  absl::Status removed = why;
  if (absl::IsCancelled(why)) {
    Interrupt fresh;
    ClientOptions options;
    options.retry_seconds = 0;
    options.call_seconds = 5;
    // The channel was made once from the same options.
    const auto channel = Connect(session.connection);
    removed = channel.ok() ? Client(*channel, options, fresh).DeleteJob(job) : channel.status();
  } else if (!MayBeTriedAgain(why)) {
    removed = session.client().DeleteJob(job);
  }
  Note(removed.ok() ? absl::StrCat(job, " was removed again")
                    : absl::StrCat(job,
                                   " was not started and is still there; remove it with: "
                                   "litags delete ",
                                   job));
}

void Note(std::string_view text) {
  const char* clear_progress = isatty(STDERR_FILENO) != 0 ? "\r\x1b[K" : "";
  std::fprintf(stderr, "%s%s\n", clear_progress, report::Printable(text).c_str());
  std::fflush(stderr);
}

CLI::Option* AddJobArgument(CLI::App& command, std::string& job) {
  return command
      .add_option_function<std::string>(
          "JOB", [&job](const std::string& text) { job = JobName(text); },
          "The job, as jobs/ID or ID")
      ->required();
}

}  // namespace litags::client
