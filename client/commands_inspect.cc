// litags inspect: what of a folder would be used. Decoders are the engine's, which this program has
// none of: it becomes litags-inspect.
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <string>
#include <string_view>
#include <vector>

#include "client/cli.h"
#include "client/sibling.h"

namespace litags::client {
namespace {

constexpr char kCommand[] = "inspect", kProgram[] = "litags-inspect";

// Returns only if there is no such program.
int BecomeInspect(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), kProgram);
  std::vector<char*> argv;
  for (std::string& argument : arguments) argv.push_back(argument.data());
  argv.push_back(nullptr);
  sigset_t none;
  sigemptyset(&none);
  sigprocmask(SIG_SETMASK, &none, nullptr);  // ours waits for signals in a thread
  execvp(SiblingProgram(kProgram).c_str(), argv.data());
  Note(SiblingMissing(kProgram, errno));
  return kExitBadInput;
}

}  // namespace

std::optional<int> MaybeInspect(int argc, char** argv) {
  if (argc < 2 || std::string_view(argv[1]) != kCommand) return std::nullopt;
  return BecomeInspect({argv + 2, argv + argc});
}

void AddInspectCommand(CLI::App& app, Session& session) {
  CLI::App* command = app.add_subcommand(
      kCommand, "Say what of a folder of photos, or of a video, would be used; needs no server");
  command->prefix_command();
  command->fallthrough(false);  // its options are the other program's
  command->callback(
      [&session, command] { session.exit_code = BecomeInspect(command->remaining()); });
}

}  // namespace litags::client
