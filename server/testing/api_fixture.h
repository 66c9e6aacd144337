#ifndef LITAGS_SERVER_TESTING_API_FIXTURE_H_
#define LITAGS_SERVER_TESTING_API_FIXTURE_H_

#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <thread>

#include "engine/core/temp_dir_test_util.h"
#include "server/api/server.h"
#include "server/jobs/leases.h"
#include "server/store/installation_marker.h"
#include "server/testing/fake_engine.h"
#include "server/testing/test_client.h"
#include "server/worker/worker.h"

namespace litags {

// The call is refused with this code and, in its ErrorDetail, this reason and field.
#define EXPECT_REFUSED(call, code, why, where)                              \
  do {                                                                      \
    const grpc::Status refused = (call);                                    \
    EXPECT_EQ(refused.error_code(), grpc::code) << refused.error_message(); \
    EXPECT_EQ(DetailOf(refused).reason, why) << refused.error_message();    \
    EXPECT_EQ(DetailOf(refused).field, where) << refused.error_message();   \
    EXPECT_FALSE(refused.error_message().empty());                          \
  } while (false)

// The real handlers over an in-process channel, the real store, and, once asked for, one worker as
// a thread, all with the fake engine.
class ApiTest : public ::testing::Test {
 protected:
  ~ApiTest() override {
    stop_.Cancel();
    if (worker_.joinable()) worker_.join();
  }

  void StartWorker() {
    EXPECT_TRUE(marker_.Claim().ok());
    worker_ = std::thread([this] {
      WorkerOptions options;
      options.name = "test-worker";
      options.poll_seconds = 0.05;
      options.progress_seconds = 0.02;
      RunWorker({store_.get(), blobs_.get(), &leases_, engine_.get(), data_, &marker_}, options,
                stop_);
    });
  }

  // A job that the worker, which begins with it, has done.
  std::string FinishedJob() {
    StartWorker();
    const std::string job = client_.StartedJob({"a", "b", "c"}, 10);
    client_.WaitFor(job, v1::JOB_STATE_SUCCEEDED);
    return job;
  }

  std::string NewJob() {
    v1::Job job;
    EXPECT_TRUE(client_.Create({}, &job).ok());
    return job.name();
  }

  static ServerOptions Options() {
    ServerOptions options;
    options.listen = "";
    options.render.max_pixels = 1'000'000;
    return options;
  }

  TempDir dir_;
  DataDir data_ = *DataDir::Open(dir_.path());
  std::unique_ptr<JobStore> store_ = *OpenSqliteJobStore(data_.database());
  std::unique_ptr<BlobStore> blobs_ = *OpenDiskBlobStore(data_.blobs());
  const InstallationMarker marker_{*store_->InstallationId(), data_.blobs(), blobs_.get()};
  Jobs jobs_{store_.get(), blobs_.get(), data_};
  Leases leases_{store_.get(), blobs_.get()};
  std::unique_ptr<Engine> engine_ = MakeFakeEngine();
  std::unique_ptr<Server> server_ = *StartServer(Options(), &jobs_, engine_.get());
  TestClient client_{server_->InProcessChannel()};
  CancelToken stop_;
  std::thread worker_;
};

}  // namespace litags

#endif  // LITAGS_SERVER_TESTING_API_FIXTURE_H_
