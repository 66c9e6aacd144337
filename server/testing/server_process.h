#ifndef LITAGS_SERVER_TESTING_SERVER_PROCESS_H_
#define LITAGS_SERVER_TESTING_SERVER_PROCESS_H_

#include <grpcpp/create_channel.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "server/testing/eventually.h"
#include "server/testing/test_client.h"

namespace litags {

// A server's program with a folder of its own, and a client to it.
class ServerProcess {
 public:
  ServerProcess(std::string program, std::string folder) : program_(program), folder_(folder) {}
  ~ServerProcess() { End(SIGTERM); }

  void Launch(const std::vector<std::string>& flags = {}) {
    const std::string port_file = folder_ + "/port";
    unlink(port_file.c_str());
    std::vector<std::string> args = {program_,  "--listen",        "127.0.0.1:0",
                                     "--data",  folder_ + "/data", "--port-file",
                                     port_file, "--log-level",     "warn"};
    args.insert(args.end(), flags.begin(), flags.end());
    std::vector<char*> argv;
    for (std::string& arg : args) argv.push_back(arg.data());
    argv.push_back(nullptr);
    pid_ = fork();
    if (pid_ == 0) {
      execv(program_.c_str(), argv.data());
      _exit(127);
    }
    int port = 0;
    const auto starts = [&] { return (std::ifstream(port_file) >> port) && port > 0; };
    ASSERT_TRUE(Eventually(starts)) << "the server did not start";
    client_ = std::make_unique<TestClient>(grpc::CreateChannel("127.0.0.1:" + std::to_string(port),
                                                               grpc::InsecureChannelCredentials()));
  }

  // Returns its exit status, as waitpid gives it.
  int End(int signal) {
    if (pid_ <= 0) return 0;
    kill(pid_, signal);
    int status = 0;
    waitpid(pid_, &status, 0);
    pid_ = -1;
    return status;
  }

  pid_t pid() const { return pid_; }
  TestClient& client() { return *client_; }

 private:
  std::string program_;
  std::string folder_;
  pid_t pid_ = -1;
  std::unique_ptr<TestClient> client_;
};

}  // namespace litags

#endif  // LITAGS_SERVER_TESTING_SERVER_PROCESS_H_
