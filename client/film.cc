#include "client/film.h"

#include <spawn.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <vector>

#include "absl/strings/str_cat.h"
#include "client/sibling.h"
#include "client/status.h"

extern char** environ;

namespace litags::client {
namespace {

constexpr char kProgram[] = "litags-film", kField[] = "--video";
constexpr int kDescriptor = 3;
constexpr int kSaidWhy = 2;  // its exit code behind an error that it has printed

// With `socket` as its standard input and output and `file` as kDescriptor; errno if it cannot be
// started.
int Spawn(const std::vector<std::string>& command, int socket, int file, pid_t* pid) {
  std::vector<char*> argv;
  for (const std::string& word : command) argv.push_back(const_cast<char*>(word.c_str()));
  argv.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, socket, STDIN_FILENO);
  posix_spawn_file_actions_adddup2(&actions, socket, STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&actions, file, kDescriptor);
  const int error = posix_spawnp(pid, argv[0], &actions, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  return error;
}

}  // namespace

Film::~Film() {
  if (pid_ >= 0) (void)End();
}

absl::Status Film::Start(const std::string& path, int frames_per_second) {
  path_ = path;
  if (absl::Status opened = file_.Open(path); !opened.ok()) return opened;
  // Not a pipe: writing to a program that has ended must be no signal.
  int ends[2];
  int error = socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) == 0 ? 0 : errno;
  if (error == 0) {
    input_ = ends[0];
    error = Spawn({SiblingProgram(kProgram), "--fps", absl::StrCat(frames_per_second),
                   "--descriptor", absl::StrCat(kDescriptor), "--", path},
                  ends[1], file_.descriptor(), &pid_);
    close(ends[1]);
  }
  if (error == 0) return IsReady() ? absl::OkStatus() : Failed();
  pid_ = -1;
  if (input_ >= 0) close(input_);
  return LocalError(absl::StatusCode::kFailedPrecondition, "VIDEO_PROGRAM_MISSING", kField,
                    absl::StrCat(path, ": ", SiblingMissing(kProgram, error)));
}

bool Film::IsReady() {
  char byte = 0;
  while (byte != '\n') {
    const ssize_t got = recv(input_, &byte, 1, 0);
    if (got == 0 || (got < 0 && errno != EINTR)) return false;
  }
  return true;
}

absl::Status Film::Add(std::string_view picture) {
  const bool sent = Send(absl::StrCat(picture.size(), "\n")) && Send(picture);
  return sent ? absl::OkStatus() : Failed();
}

absl::Status Film::Finish() {
  const bool sent = Send("0\n");
  const int exit = End();
  said_why_ = exit == kSaidWhy;
  return exit == 0 && sent ? file_.Commit() : Failed();
}

bool Film::Send(std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t sent = send(input_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (sent < 0 && errno != EINTR) return false;
    if (sent > 0) bytes.remove_prefix(static_cast<size_t>(sent));
  }
  return true;
}

int Film::End() {
  close(input_);
  int status = 0;
  while (waitpid(pid_, &status, 0) < 0 && errno == EINTR) {
  }
  pid_ = -1;
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

absl::Status Film::Failed() {
  if (pid_ >= 0) said_why_ = End() == kSaidWhy;
  return BadInput("VIDEO_FAILED", kField,
                  absl::StrCat(path_, ": is not written; ", kProgram,
                               said_why_ ? " has said why" : " ended without a word of why"));
}

}  // namespace litags::client
