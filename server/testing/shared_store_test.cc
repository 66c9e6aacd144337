// Two servers, each with a worker and a data folder of its own, on one PostgreSQL and one
// folder of blobs, over real sockets.
#include <curl/curl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <thread>

#include "engine/core/temp_dir_test_util.h"
#include "server/testing/eventually.h"
#include "server/testing/free_port.h"
#include "server/testing/postgres_server.h"
#include "server/testing/server_process.h"

namespace litags {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

// What a server answers at its --metrics-listen.
std::string MetricsAt(const std::string& address) {
  std::string text;
  CURL* const curl = curl_easy_init();
  curl_easy_setopt(curl, CURLOPT_URL, ("http://" + address + "/metrics").c_str());
  curl_easy_setopt(curl, CURLOPT_NOPROXY, "*");
  curl_easy_setopt(curl, CURLOPT_TIMEOUT, 30L);
  curl_easy_setopt(curl, CURLOPT_WRITEDATA, &text);
  curl_easy_setopt(
      curl, CURLOPT_WRITEFUNCTION, +[](char* bytes, size_t, size_t size, void* out) {
        static_cast<std::string*>(out)->append(bytes, size);
        return size;
      });
  EXPECT_EQ(curl_easy_perform(curl), CURLE_OK);
  curl_easy_cleanup(curl);
  return text;
}

class SharedStore : public ::testing::Test {
 protected:
  void SetUp() override {
    postgres_ = SharedPostgres();
    if (!postgres_) GTEST_SKIP() << "PostgreSQL is not installed here";
    url_ = *postgres_->NewDatabase();
    for (const char* folder : {"a", "b"}) {
      std::filesystem::create_directory(dir_.path() + "/" + folder);
    }
    a_.Launch(Flags());
    b_.Launch(Flags());
  }

  std::vector<std::string> Flags() const {
    return {"--store", url_, "--blobs", "file://" + dir_.path() + "/blobs"};
  }

  TempDir dir_;
  PostgresServer* postgres_ = nullptr;
  std::string url_;
  ServerProcess a_{FAKE_SERVER, dir_.path() + "/a"};
  ServerProcess b_{FAKE_SERVER, dir_.path() + "/b"};
};

TEST_F(SharedStore, WhatOneServerIsToldTheOtherKnows) {
  const std::string name = a_.client().StartedJob({"a", "b", "c"});
  EXPECT_EQ(b_.client().History(name), "UPLOADING QUEUED RUNNING SUCCEEDED ");
  v1::RenderViewRequest request;
  request.set_name(name);
  request.mutable_pose()->set_camera("a.png");
  v1::RenderedView view;
  for (ServerProcess* server : {&a_, &b_}) {
    const grpc::Status status = server->client().Render(request, &view);
    EXPECT_TRUE(status.ok()) << status.error_message();
  }
  EXPECT_TRUE(b_.client().Delete(name).ok());
  v1::Job job;
  EXPECT_EQ(a_.client().Get(name, &job).error_code(), grpc::NOT_FOUND);
}

TEST_F(SharedStore, JobIsCancelledAtOneServerAndResumedAtTheOther) {
  const std::string name = a_.client().StartedJob({"slow", "b", "c"}, 500);
  a_.client().WaitFor(name, v1::JOB_STATE_RUNNING);
  ASSERT_TRUE(b_.client().Cancel(name).ok());
  a_.client().WaitFor(name, v1::JOB_STATE_CANCELLED);
  ASSERT_TRUE(a_.client().Resume(name).ok());
  b_.client().WaitFor(name, v1::JOB_STATE_SUCCEEDED, 60);
  EXPECT_EQ(a_.client().History(name),
            "UPLOADING QUEUED RUNNING CANCELLED QUEUED RUNNING SUCCEEDED ");
}

TEST_F(SharedStore, ManyJobsAreEachRunOnceAndBothServersWork) {
  std::vector<std::string> names;
  for (int i = 0; i < 6; ++i) {
    names.push_back((i % 2 ? a_ : b_).client().StartedJob({"a", "b", "c"}));
  }
  for (const std::string& name : names) {
    a_.client().WaitFor(name, v1::JOB_STATE_SUCCEEDED, 60);
    EXPECT_EQ(b_.client().History(name), "UPLOADING QUEUED RUNNING SUCCEEDED ");
  }
}

TEST_F(SharedStore, JobOfAKilledServerGoesOnAtTheOtherFromItsCheckpoint) {
  b_.End(SIGTERM);  // so that the job runs at the other
  const std::string name = a_.client().StartedJob({"slow", "b", "c"}, 500);
  v1::Job job;
  ASSERT_TRUE(Eventually(
      [&] { return a_.client().Get(name, &job).ok() && job.snapshot_iteration() >= 1; }));
  ASSERT_EQ(job.state(), v1::JOB_STATE_RUNNING);
  b_.Launch(Flags());
  a_.End(SIGKILL);
  job = b_.client().WaitFor(name, v1::JOB_STATE_SUCCEEDED, 60);  // once the lease has run out
  EXPECT_EQ(job.attempt(), 2);
  EXPECT_EQ(b_.client().History(name), "UPLOADING QUEUED RUNNING QUEUED RUNNING SUCCEEDED ");
  ASSERT_EQ(job.report().notes_size(), 1);
  EXPECT_THAT(job.report().notes(0), HasSubstr("resumed at iteration"));
}

TEST_F(SharedStore, RunningJobOutlivesARestartOfTheDatabase) {
  const std::string metrics_at = "127.0.0.1:" + std::to_string(FreePort());
  std::vector<std::string> flags = Flags();
  flags.insert(flags.end(), {"--metrics-listen", metrics_at});
  b_.End(SIGTERM);
  b_.Launch(flags);
  const std::string name = a_.client().StartedJob({"slow", "b", "c"}, 200);
  a_.client().WaitFor(name, v1::JOB_STATE_RUNNING);
  postgres_->Crash();
  v1::Job job;
  const grpc::Status away = b_.client().Get(name, &job);
  EXPECT_EQ(away.error_code(), grpc::UNAVAILABLE);
  EXPECT_EQ(DetailOf(away).reason, "STORE_UNAVAILABLE");
  const std::string metrics = MetricsAt(metrics_at);
  EXPECT_THAT(metrics, HasSubstr("\nlitags_store_up 0\n"));
  EXPECT_THAT(metrics, Not(HasSubstr("litags_jobs")));   // left out, not out of date
  std::this_thread::sleep_for(std::chrono::seconds(6));  // the job itself is done by now
  ASSERT_TRUE(postgres_->Run().ok());
  // Servers that were refused just now ask again after a moment (PostgresPool).
  EXPECT_TRUE(Eventually([&] { return b_.client().Get(name, &job).ok(); }));
  job = b_.client().WaitFor(name, v1::JOB_STATE_SUCCEEDED, 60);
  EXPECT_EQ(job.attempt(), 1);
  EXPECT_EQ(a_.client().History(name), "UPLOADING QUEUED RUNNING SUCCEEDED ");
}

}  // namespace
}  // namespace litags
