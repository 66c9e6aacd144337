// litags: the command line over a litags server.
#include <pthread.h>
#include <signal.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <thread>

#include "client/cli.h"
#include "proto/arguments/arguments.h"

namespace {

using litags::client::Interrupt;

constexpr double kMostSeconds = 1e6;  // of a wait

constexpr char kFooter[] = R"(
JOB is jobs/ID or ID. Results go to stdout, everything else to stderr. litags --help has the
options of the connection, as --server.

Exit codes: 0 ok; 1 the job failed or was cancelled; 2 bad usage or input; 3 no server answers;
4 no such job or camera; 5 other errors, as of a job whose state does not allow the command;
130 interrupted.

  litags submit photos/ --watch
  litags render JOB --camera 0012.jpg -o view.png
  litags path JOB --orbit --frames 60 -o frames/
  litags export JOB -o scene.ply
  litags report JOB -o report.html)";

// Turns Ctrl-C into interrupt.Raise(); a second one ends the program at once. Must be called
// before any other thread exists, so that all inherit the mask. Signals that the parent ignores
// (nohup) stay ignored.
void HandleSignals(Interrupt& interrupt) {
  sigset_t signals;
  sigemptyset(&signals);
  for (const int number : {SIGINT, SIGTERM, SIGHUP}) {
    struct sigaction action {};
    if (sigaction(number, nullptr, &action) == 0 && action.sa_handler != SIG_IGN) {
      sigaddset(&signals, number);
    }
  }
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  std::thread([signals, &interrupt] {
    int number = 0;
    if (sigwait(&signals, &number) != 0) return;
    interrupt.Raise();
    if (sigwait(&signals, &number) == 0) _exit(litags::client::kExitInterrupted);
  }).detach();
}

void AddConnectionOptions(CLI::App& app, litags::client::ConnectionOptions& options) {
  app.add_option("--server", options.server,
                 "Address of the server, host:port, or unix:PATH on this machine; several of one "
                 "service as host:port,host:port")
      ->envname("LITAGS_SERVER")
      ->default_val("127.0.0.1:50051");
  app.add_flag("--tls", options.tls, "Encrypt, trusting the system's root certificates")
      ->envname("LITAGS_TLS");
  app.add_option("--tls-ca", options.tls_ca, "Encrypt, trusting the certificates of this PEM file")
      ->envname("LITAGS_TLS_CA");
  app.add_option("--tls-cert", options.tls_cert, "Our certificate (PEM), for mutual TLS")
      ->envname("LITAGS_TLS_CERT");
  app.add_option("--tls-key", options.tls_key, "Its private key (PEM)")->envname("LITAGS_TLS_KEY");
  app.add_option("--tls-name", options.tls_name,
                 "The name in the server's certificate, if it is not that of --server")
      ->envname("LITAGS_TLS_NAME");
  // No flag for the token itself: other users of the machine see command lines.
  app.add_option("--token-file", options.token_file,
                 "File with the token that names us; LITAGS_TOKEN holds one itself")
      ->envname("LITAGS_TOKEN_FILE");
  app.add_option("--keepalive", options.keepalive_seconds,
                 "Seconds after which a silent server is asked whether it is there")
      ->capture_default_str()
      ->check(litags::Between(0.001, kMostSeconds));
  app.add_option("--keepalive-timeout", options.keepalive_timeout_seconds,
                 "Seconds that it may take to answer")
      ->capture_default_str()
      ->check(litags::Between(0.001, kMostSeconds));
  if (const char* token = std::getenv("LITAGS_TOKEN")) options.token = token;
}

int Main(int argc, char** argv) {
  if (const auto exit = litags::client::MaybeInspect(argc, argv)) return *exit;
  // What gRPC logs of failed connections is in our errors, once and in plain words.
  setenv("GRPC_VERBOSITY", "NONE", /*overwrite=*/0);
  // Lives until the process ends: the signal thread refers to it.
  auto& session = *new litags::client::Session;
  HandleSignals(session.interrupt);

  CLI::App app("litags: photos taken in bad light go in, normally lit views come out");
  app.name("litags");
  app.set_version_flag("--version", LITAGS_VERSION);
  AddConnectionOptions(app, session.connection);
  app.add_option("--retry", session.retry_seconds,
                 "Seconds for which a connection that broke is tried again")
      ->default_val(120)
      ->check(litags::Between(0.0, kMostSeconds));
  app.require_subcommand(1);
  // Runs before the command's own callback, with all options known.
  app.parse_complete_callback([&session] {
    if (const absl::Status status = session.Open(); !status.ok()) {
      session.exit_code = ReportError(session, status);
      throw CLI::RuntimeError(session.exit_code);
    }
  });
  app.fallthrough();
  app.footer(kFooter);
  litags::client::AddSubmitCommand(app, session);
  litags::client::AddWatchCommand(app, session);
  litags::client::AddJobCommands(app, session);
  litags::client::AddManageCommands(app, session);
  litags::client::AddResumeCommand(app, session);
  litags::client::AddRenderCommands(app, session);
  litags::client::AddExportCommand(app, session);
  litags::client::AddReportCommand(app, session);
  litags::client::AddDoctorCommand(app, session);
  litags::client::AddInspectCommand(app, session);
  if (const auto exit = litags::ParseArguments(app, argc, argv)) return *exit;
  return litags::FlushOutput(session.exit_code, litags::client::kExitServerError);
}

}  // namespace

int main(int argc, char** argv) {
  return litags::RunProgram(
      "litags", [&] { return Main(argc, argv); }, litags::client::kExitServerError);
}
