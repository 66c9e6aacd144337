#ifndef LITAGS_SERVER_TESTING_S3_SERVER_H_
#define LITAGS_SERVER_TESTING_S3_SERVER_H_

#include <sys/types.h>

#include <memory>

#include "engine/core/temp_dir_test_util.h"
#include "server/store/blob_store.h"

namespace litags {

// An S3 server as a process: OpenStack Swift, see tests/s3.
class S3Server {
 public:
  // Null if there is none on this machine.
  static std::unique_ptr<S3Server> Start();
  ~S3Server();

  // At the port that it had, if it had one.
  void Run();
  void Kill();
  int port() const { return port_; }
  // Of a store in its bucket under a prefix of its own.
  S3Options Options();

 private:
  S3Server() = default;

  TempDir dir_;
  int port_ = 0;
  pid_t pid_ = -1;
  int stores_ = 0;
};

// The one that the tests of this process share; null if there is none.
S3Server* SharedS3();

}  // namespace litags

#endif  // LITAGS_SERVER_TESTING_S3_SERVER_H_
