// What the commands of the program `litags` share. Each commands_*.cc adds its commands to the
// parser; running one leaves its exit code in the session.
#ifndef LITAGS_CLIENT_CLI_H_
#define LITAGS_CLIENT_CLI_H_

#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "CLI/CLI.hpp"
#include "absl/status/status.h"
#include "client/client.h"
#include "client/connection.h"
#include "client/exit_code.h"
#include "client/interrupt.h"

namespace litags::client {

// One run of the program.
class Session {
 public:
  ConnectionOptions connection;
  double retry_seconds = 120;
  Interrupt interrupt;
  int exit_code = kExitOk;

  // Makes the channel; OK before the command runs, else the error is the command's.
  absl::Status Open();
  // After Open().
  Client& client() { return *client_; }

 private:
  std::unique_ptr<Client> client_;
};

// Prints an error to stderr: what, which field, what to do next. Returns its exit code. `job` is
// named in the commands it proposes; may be empty.
int ReportError(const Session& session, const absl::Status& status, const std::string& job = "");

// Whether a start that failed with `why` may have started the job all the same: what was lost is
// perhaps only the answer.
bool MayHaveStarted(const absl::Status& why);
void NoteMayHaveStarted(const std::string& job);

// Removes a job that was not started because of `why`, and says so. It stays where no server
// answers.
void RemoveUnstarted(Session& session, const std::string& job, const absl::Status& why);

// A line to stderr; on a terminal in place of the progress line that is drawn there.
void Note(std::string_view text);

// In one line, or indented.
void PrintJson(const google::protobuf::Message& message, bool pretty, std::FILE* out = stdout);

// Says on stderr where a job stands in the queue, or what it needs and no worker has.
void NoteWaiting(Session& session, const std::string& job);

// Follows a job from event `after` on until it ends: on a terminal a progress line that is drawn
// anew, else one line per event, to `out`; with `json` each event as a JSON object per line.
// Returns the exit code.
int FollowJob(Session& session, const std::string& job, int64_t after, std::FILE* out, bool json);

void AddSubmitCommand(CLI::App& app, Session& session);
void AddWatchCommand(CLI::App& app, Session& session);
void AddJobCommands(CLI::App& app, Session& session);     // list, show, cancel, delete
void AddManageCommands(CLI::App& app, Session& session);  // info, files, log, update, clone
void AddResumeCommand(CLI::App& app, Session& session);
void AddRenderCommands(CLI::App& app, Session& session);  // render, path, cameras
void AddReportCommand(CLI::App& app, Session& session);
void AddExportCommand(CLI::App& app, Session& session);
void AddDoctorCommand(CLI::App& app, Session& session);
void AddInspectCommand(CLI::App& app, Session& session);

// For the first line of main(): `litags inspect ...` needs no server, nor what is known of one.
// Returns only if it cannot be started.
std::optional<int> MaybeInspect(int argc, char** argv);

// Adds the positional JOB, "ID" or "jobs/ID", which is stored as "jobs/ID".
CLI::Option* AddJobArgument(CLI::App& command, std::string& job);

}  // namespace litags::client

#endif  // LITAGS_CLIENT_CLI_H_
