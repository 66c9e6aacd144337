#include "server/testing/postgres_server.h"

#include <fcntl.h>
#include <grp.h>
#include <pwd.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <thread>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "server/store/open_stores.h"
#include "server/store/postgres.h"
#include "server/store/postgres_migrations.h"
#include "server/testing/free_port.h"
#include "server/testing/job_store_kind.h"

namespace litags {
namespace {

namespace fs = std::filesystem;

// Debian's place; empty if there is none.
std::string FindPrograms() {
  std::string newest;
  std::error_code error;
  for (const auto& version : fs::directory_iterator("/usr/lib/postgresql", error)) {
    const std::string folder = version.path() / "bin";
    if (fs::exists(folder + "/initdb") && folder > newest) newest = folder;
  }
  return newest;
}

class PostgresKind : public JobStoreKind {
 public:
  explicit PostgresKind(std::string url) : url_(std::move(url)) {}
  absl::StatusOr<std::unique_ptr<JobStore>> Open() override { return OpenPostgresJobStore(url_); }

  absl::Status MakeOldest() override {
    LITAGS_ASSIGN_OR_RETURN(const auto old, PgConnection::Open(url_));
    LITAGS_RETURN_IF_ERROR(MigratePostgres(old.get(), /*last=*/1));
    return old->Execute(kInsertOldJob);
  }

  absl::Status SetVersion(int64_t version) override {
    LITAGS_ASSIGN_OR_RETURN(const auto connection, PgConnection::Open(url_));
    return connection->Execute(absl::StrCat("UPDATE litags_schema SET version = ", version));
  }

  absl::Status Check() override { return CheckJobStore({url_, "", ""}, {}); }

 private:
  const std::string url_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<PostgresServer>> PostgresServer::Start(bool durable) {
  std::unique_ptr<PostgresServer> server(new PostgresServer);
  server->programs_ = FindPrograms();
  if (server->programs_.empty()) return absl::NotFoundError("PostgreSQL is not installed");
  server->durable_ = durable;
  server->user_ = getuid();
  server->group_ = getgid();
  if (server->user_ == 0) {  // refused by initdb
    const passwd* user = getpwnam("postgres");
    if (!user) user = getpwnam("nobody");
    if (!user) return absl::NotFoundError("there is no user to run PostgreSQL as");
    server->user_ = user->pw_uid;
    server->group_ = user->pw_gid;
    if (chown(server->dir_.path().c_str(), server->user_, server->group_) != 0) {
      return absl::ErrnoToStatus(errno, "chown");
    }
  }
  LITAGS_RETURN_IF_ERROR(server->RunProgram({"initdb", "-D", server->dir_.path() + "/data", "-U",
                                             "litags", "--auth=trust", "--encoding=UTF8",
                                             "--locale=C.UTF-8", "--no-sync", "-N"}));
  absl::Status status;
  for (int i = 0; i < 5; ++i) {  // until no other process has taken the port in between
    server->port_ = FreePort();
    status = server->Run();
    if (server->pid_ > 0) break;
  }
  LITAGS_RETURN_IF_ERROR(status);
  return server;
}

PostgresServer::~PostgresServer() { Stop(); }

pid_t PostgresServer::Spawn(const std::vector<std::string>& args) const {
  const std::string program = programs_ + "/" + args[0];
  std::vector<char*> argv;
  for (const std::string& arg : args) argv.push_back(const_cast<char*>(arg.c_str()));
  argv.push_back(nullptr);
  const std::string log = dir_.path() + "/log";
  const pid_t pid = fork();
  if (pid != 0) return pid;
  if (getuid() == 0 && (setgroups(0, nullptr) != 0 || setgid(group_) != 0 || setuid(user_) != 0)) {
    _exit(126);
  }
  prctl(PR_SET_PDEATHSIG, SIGQUIT);
  const int out = open(log.c_str(), O_WRONLY | O_CREAT | O_APPEND, 0600);
  dup2(out, STDOUT_FILENO);
  dup2(out, STDERR_FILENO);
  if (chdir("/") != 0) _exit(126);
  execv(program.c_str(), argv.data());
  _exit(127);
}

absl::Status PostgresServer::RunProgram(const std::vector<std::string>& args) const {
  const pid_t pid = Spawn(args);
  int status = 0;
  if (waitpid(pid, &status, 0) == pid && WIFEXITED(status) && WEXITSTATUS(status) == 0) {
    return absl::OkStatus();
  }
  return absl::InternalError(absl::StrCat(args[0], " failed; see ", dir_.path(), "/log"));
}

absl::Status PostgresServer::Run() {
  pid_ = Spawn({"postgres", "-D", dir_.path() + "/data", "-k", dir_.path(), "-p",
                absl::StrCat(port_), "-c", "listen_addresses=127.0.0.1", "-c",
                durable_ ? "fsync=on" : "fsync=off", "-c", "max_connections=100"});
  for (int i = 0; i < 600; ++i) {
    const auto connection = PgConnection::Open(Url("postgres"));
    if (connection.ok()) return absl::OkStatus();
    if (waitpid(pid_, nullptr, WNOHANG) == pid_) {
      pid_ = -1;
      return absl::InternalError("the PostgreSQL server ended; see " + dir_.path() + "/log");
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  return absl::InternalError("the PostgreSQL server does not answer");
}

void PostgresServer::End(int signal) {
  if (pid_ <= 0) return;
  kill(pid_, signal);
  waitpid(pid_, nullptr, 0);
  pid_ = -1;
}

void PostgresServer::Stop() { End(SIGINT); }
void PostgresServer::Crash() { End(SIGQUIT); }

std::string PostgresServer::Url(const std::string& database) const {
  return absl::StrCat("postgresql:///", database, "?host=", dir_.path(), "&port=", port_,
                      "&user=litags");
}

std::string PostgresServer::OverTcp(const std::string& url) const {
  return absl::StrReplaceAll(url, {{"host=" + dir_.path(), "host=127.0.0.1"}});
}

absl::Status PostgresServer::Execute(const std::string& sql) {
  LITAGS_ASSIGN_OR_RETURN(const auto connection, PgConnection::Open(Url("postgres")));
  return connection->Execute(sql);
}

absl::StatusOr<std::string> PostgresServer::NewDatabase() {
  const std::string name = absl::StrCat("test", ++databases_);
  LITAGS_RETURN_IF_ERROR(Execute("CREATE DATABASE " + name));
  return Url(name);
}

PostgresServer* SharedPostgres() {
  static const std::unique_ptr<PostgresServer> server = [] {
    auto started = PostgresServer::Start();
    if (absl::IsNotFound(started.status())) return std::unique_ptr<PostgresServer>();
    EXPECT_TRUE(started.ok()) << started.status();
    return started.ok() ? *std::move(started) : nullptr;
  }();
  return server.get();
}

std::unique_ptr<JobStoreKind> MakeTestedKind() {
  if (!SharedPostgres()) return nullptr;
  const auto url = SharedPostgres()->NewDatabase();
  EXPECT_TRUE(url.ok()) << url.status();
  return url.ok() ? std::make_unique<PostgresKind>(*url) : nullptr;
}

}  // namespace litags
