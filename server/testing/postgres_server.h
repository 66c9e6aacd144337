#ifndef LITAGS_SERVER_TESTING_POSTGRES_SERVER_H_
#define LITAGS_SERVER_TESTING_POSTGRES_SERVER_H_

#include <sys/types.h>

#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "engine/core/temp_dir_test_util.h"

namespace litags {

// A PostgreSQL server of this machine's package, with a cluster of its own in a temporary folder,
// reached by a Unix socket and by a port on loopback. Ends with this object, at the latest with
// this process.
class PostgresServer {
 public:
  // The newest one installed; NOT_FOUND if there is none. What is committed survives a power cut if
  // `durable`, at the price that it has in operation.
  static absl::StatusOr<std::unique_ptr<PostgresServer>> Start(bool durable = false);
  ~PostgresServer();

  // Ends it as SIGTERM, or as a power cut would, and starts it again.
  absl::Status Run();
  void Stop();
  void Crash();

  // A new, empty database; its URL.
  absl::StatusOr<std::string> NewDatabase();
  // The same database over the port instead of the socket.
  std::string OverTcp(const std::string& url) const;
  absl::Status Execute(const std::string& sql);
  int port() const { return port_; }
  pid_t pid() const { return pid_; }

 private:
  PostgresServer() = default;
  std::string Url(const std::string& database) const;
  // Runs a program of the package as a user that PostgreSQL accepts, to its end.
  absl::Status RunProgram(const std::vector<std::string>& args) const;
  pid_t Spawn(const std::vector<std::string>& args) const;
  void End(int signal);

  TempDir dir_;
  std::string programs_;  // folder
  bool durable_ = false;
  int port_ = 0;
  uid_t user_ = 0;
  gid_t group_ = 0;
  pid_t pid_ = -1;
  int databases_ = 0;
};

// The server that the tests of this process share; null if PostgreSQL is not installed.
PostgresServer* SharedPostgres();

}  // namespace litags

#endif  // LITAGS_SERVER_TESTING_POSTGRES_SERVER_H_
