// litags watch: a job's events as they come.
#include <sys/ioctl.h>
#include <unistd.h>

#include <cstdio>
#include <memory>

#include "absl/strings/str_cat.h"
#include "client/cli.h"
#include "client/report/text.h"
#include "client/text.h"

namespace litags::client {
namespace {

// Shows events on a terminal or in a pipe.
class EventPrinter {
 public:
  EventPrinter(std::FILE* out, bool json)
      : out_(out), json_(json), terminal_(!json && isatty(fileno(out)) != 0) {}
  ~EventPrinter() { EndLine(); }

  void Print(const v1::JobEvent& event) {
    if (json_) {
      PrintJson(event, /*pretty=*/false, out_);
    } else if (!terminal_) {
      std::fprintf(out_, "%s\n", EventLine(event).c_str());
    } else if (event.has_progress()) {
      std::fprintf(out_, "\r%s\x1b[K", ProgressLine(event.progress(), Columns()).c_str());
      line_open_ = true;
    } else if (event.has_state_change()) {
      EndLine();
      std::fprintf(out_, "%s\n", EventLine(event).c_str());
    }
    std::fflush(out_);
  }

  // Leaves what was drawn last and goes to a fresh line.
  void EndLine() {
    if (line_open_) std::fputc('\n', out_);
    line_open_ = false;
  }

 private:
  // One less than the terminal is wide: some wrap as soon as the last column is filled.
  size_t Columns() const {
    winsize size{};
    if (ioctl(fileno(out_), TIOCGWINSZ, &size) != 0 || size.ws_col < 2) return 79;
    return size.ws_col - 1u;
  }

  std::FILE* out_;
  bool json_;
  bool terminal_;
  bool line_open_ = false;
};

}  // namespace

void NoteWaiting(Session& session, const std::string& job) {
  const auto found = session.client().GetJob(job);
  if (!found.ok()) return;  // errors are the next call's to report
  if (!found->waits_for().empty()) {
    Note(absl::StrCat(job, " waits for ", report::Printable(found->waits_for())));
  } else if (found->queue_position() > 0) {
    Note(absl::StrCat(job, " is queued, number ", found->queue_position()));
  }
}

int FollowJob(Session& session, const std::string& job, int64_t after, std::FILE* out, bool json) {
  int64_t last = after;
  EventPrinter printer(out, json);
  if (!json) NoteWaiting(session, job);
  const auto result = session.client().WatchJob(job, after, [&](const v1::JobEvent& event) {
    last = event.number();
    printer.Print(event);
  });
  printer.EndLine();
  if (!result.ok()) {
    if (absl::IsCancelled(result.status())) {
      Note(absl::StrCat("stopped watching; ", job, " goes on\n  follow it again: litags watch ",
                        job, " --after ", last, "\n  stop it:         litags cancel ", job));
      return kExitInterrupted;
    }
    return ReportError(session, result.status(), job);
  }
  if (!json) {
    std::fputs(OutcomeText(*result).c_str(), out);
    std::fflush(out);
  }
  return result->state() == v1::JOB_STATE_SUCCEEDED ? kExitOk : kExitJobFailed;
}

void AddWatchCommand(CLI::App& app, Session& session) {
  struct Args {
    std::string job;
    int64_t after = 0;
    bool json = false;
  };
  auto args = std::make_shared<Args>();
  CLI::App* command = app.add_subcommand(
      "watch",
      "Follow a job until it ends; survives broken connections. Ctrl-C stops watching "
      "and leaves the job alone");
  AddJobArgument(*command, args->job);
  command->add_option("--after", args->after, "Number of the last event already seen");
  command->add_flag("--json", args->json, "Each event as a JSON object on a line of its own");
  command->callback([&session, args] {
    session.exit_code = FollowJob(session, args->job, args->after, stdout, args->json);
  });
}

}  // namespace litags::client
