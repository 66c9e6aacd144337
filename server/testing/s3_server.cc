#include "server/testing/s3_server.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <thread>

#include "absl/strings/str_cat.h"
#include "server/testing/blob_store_kind.h"

namespace litags {
namespace {

constexpr char kBucket[] = "litags-test";
constexpr char kPython[] = "/usr/bin/python3";  // Debian's, which has its packages

bool HaveSwift() {
  return std::filesystem::exists("/usr/lib/python3/dist-packages/swift/common/middleware/s3api");
}

}  // namespace

std::unique_ptr<S3Server> S3Server::Start() {
  std::unique_ptr<S3Server> server(new S3Server);
  if (!HaveSwift()) return nullptr;
  server->Run();
  return server;
}

S3Server::~S3Server() { Kill(); }

void S3Server::Run() {
  const std::string port = absl::StrCat(port_), port_file = dir_.path() + "/port";
  pid_ = fork();
  if (pid_ == 0) {
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    const int null = open("/dev/null", O_RDWR);
    dup2(null, STDOUT_FILENO);
    execl(kPython, "python3", SWIFT_SERVER, dir_.path().c_str(), port.c_str(), kBucket, nullptr);
    _exit(127);
  }
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::minutes(2);
  while (std::chrono::steady_clock::now() < deadline) {
    if (waitpid(pid_, nullptr, WNOHANG) == pid_) {
      pid_ = -1;
      break;
    }
    if (port_ == 0) std::ifstream(port_file) >> port_;
    if (port_ != 0 && OpenS3BlobStore(Options()).ok()) return;
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  }
  ADD_FAILURE() << "the S3 server does not answer at port " << port_;
}

void S3Server::Kill() {
  if (pid_ <= 0) return;
  kill(pid_, SIGKILL);
  waitpid(pid_, nullptr, 0);
  pid_ = -1;
}

S3Options S3Server::Options() {
  S3Options options;
  options.endpoint = absl::StrCat("http://127.0.0.1:", port_);
  options.bucket = kBucket;
  options.prefix = absl::StrCat("test/", ++stores_, "/");
  options.access_key = "test:litags";  // as tests/s3/swift_server.py has them
  options.secret_key = "a-secret-of-tests";
  options.part_bytes = int64_t{5} << 20;
  return options;
}

S3Server* SharedS3() {
  static const std::unique_ptr<S3Server> server = S3Server::Start();
  return server.get();
}

std::unique_ptr<BlobStore> MakeTestedBlobStore(const std::string&) {
  return SharedS3() ? *OpenS3BlobStore(SharedS3()->Options()) : nullptr;
}

}  // namespace litags
