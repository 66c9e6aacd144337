// The service as it runs: the server's program with its workers as child processes and a real
// socket, linked with the fake engine.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fstream>

#include "engine/core/monotonic_seconds.h"
#include "engine/core/temp_dir_test_util.h"
#include "server/testing/eventually.h"
#include "server/testing/server_process.h"

namespace litags {
namespace {

using ::testing::HasSubstr;

class ServiceProcess : public ::testing::Test {
 protected:
  void SetUp() override { server_.Launch(); }
  TestClient& client() { return server_.client(); }

  // Process ids of the server's children whose command has this word.
  std::vector<pid_t> Children(const std::string& word) const {
    const std::string pid = std::to_string(server_.pid());
    std::vector<pid_t> found;
    for (const auto& task : std::filesystem::directory_iterator("/proc/" + pid + "/task")) {
      std::ifstream children(task.path() / "children");
      for (pid_t child; children >> child;) {
        std::ifstream file("/proc/" + std::to_string(child) + "/cmdline");
        const std::string command(std::istreambuf_iterator<char>(file), {});
        if (command.find(word) != std::string::npos) found.push_back(child);
      }
    }
    return found;
  }
  std::vector<pid_t> Workers() const { return Children("--name"); }

  // Until the engine is where it misbehaves: half way, after the snapshot there.
  void WaitForSnapshot(const std::string& name, int iteration) {
    v1::Job job;
    ASSERT_TRUE(Eventually(
        [&] { return client().Get(name, &job).ok() && job.snapshot_iteration() >= iteration; }));
    ASSERT_EQ(job.snapshot_iteration(), iteration);
    ASSERT_EQ(job.state(), v1::JOB_STATE_RUNNING);
  }

  TempDir dir_;
  ServerProcess server_{FAKE_SERVER, dir_.path()};
};

TEST_F(ServiceProcess, JobRunsRendersAndIsDeletedOverARealSocket) {
  const std::string name = client().StartedJob({"a", "b", "c"});
  EXPECT_EQ(client().History(name), "UPLOADING QUEUED RUNNING SUCCEEDED ");
  v1::RenderViewRequest request;
  request.set_name(name);
  request.mutable_pose()->set_camera("a.png");
  v1::RenderedView view;
  const grpc::Status status = client().Render(request, &view);
  EXPECT_TRUE(status.ok()) << status.error_message();
  EXPECT_TRUE(client().Delete(name).ok());
  EXPECT_EQ(client().Get(name, std::make_unique<v1::Job>().get()).error_code(), grpc::NOT_FOUND);
}

TEST_F(ServiceProcess, CrashedWorkerIsReplacedAndTheJobGoesOnFromItsCheckpoint) {
  const std::string name = client().StartedJob({"crash-once", "b", "c"}, 60);
  EXPECT_EQ(client().History(name), "UPLOADING QUEUED RUNNING QUEUED RUNNING SUCCEEDED ");
  v1::Job job;
  ASSERT_TRUE(client().Get(name, &job).ok());
  EXPECT_EQ(job.attempt(), 2);
  ASSERT_EQ(job.report().notes_size(), 1);
  EXPECT_EQ(job.report().notes(0), "resumed at iteration 30");
}

TEST_F(ServiceProcess, JobThatKillsEveryWorkerFailsAndTheServerLivesOn) {
  const std::string name = client().StartedJob({"crash", "b", "c"}, 20);
  const v1::Job job = client().WaitFor(name, v1::JOB_STATE_FAILED, 30);
  EXPECT_EQ(job.error().detail().reason(), "WORKER_LOST");
  EXPECT_EQ(job.error().code(), grpc::ABORTED);
  EXPECT_EQ(client().History(name),
            "UPLOADING QUEUED RUNNING QUEUED RUNNING QUEUED RUNNING FAILED ");
  const std::string next = client().StartedJob({"a", "b", "c"});
  client().WaitFor(next, v1::JOB_STATE_SUCCEEDED, 30);
}

TEST_F(ServiceProcess, HangingJobIsCancelled) {
  const std::string name = client().StartedJob({"hang", "b", "c"}, 40);
  WaitForSnapshot(name, 20);
  ASSERT_TRUE(client().Cancel(name).ok());
  client().WaitFor(name, v1::JOB_STATE_CANCELLED);
}

TEST_F(ServiceProcess, EngineThatIgnoresCancellationIsLeftAndItsWorkerReplaced) {
  const std::string name = client().StartedJob({"stuck", "b", "c"}, 40);
  WaitForSnapshot(name, 20);
  ASSERT_TRUE(client().Cancel(name).ok());
  client().WaitFor(name, v1::JOB_STATE_CANCELLED);
  const std::string next = client().StartedJob({"a", "b", "c"});
  client().WaitFor(next, v1::JOB_STATE_SUCCEEDED);
}

TEST_F(ServiceProcess, StoppedServerLeavesNoWorkerAndTheJobGoesOnAfterARestart) {
  const std::string name = client().StartedJob({"slow", "b", "c"}, 500);
  client().WaitFor(name, v1::JOB_STATE_RUNNING);
  const std::vector<pid_t> workers = Workers();
  ASSERT_EQ(workers.size(), 1u);
  const double start = MonotonicSeconds();
  const int status = server_.End(SIGTERM);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0) << status;
  EXPECT_LT(MonotonicSeconds() - start, 30);
  EXPECT_NE(kill(workers[0], 0), 0);  // gone
  server_.Launch();
  EXPECT_EQ(client().History(name), "UPLOADING QUEUED RUNNING QUEUED RUNNING SUCCEEDED ");
}

TEST_F(ServiceProcess, ServerWhoseTerminalIsClosedGivesItsJobBack) {
  const std::string name = client().StartedJob({"slow", "b", "c"}, 100000);
  client().WaitFor(name, v1::JOB_STATE_RUNNING);
  const int status = server_.End(SIGHUP);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0) << status;
  server_.Launch({"--workers", "0"});
  v1::Job job;
  ASSERT_TRUE(client().Get(name, &job).ok());
  EXPECT_EQ(job.state(), v1::JOB_STATE_QUEUED);
  EXPECT_EQ(job.attempt(), 0);
}

TEST_F(ServiceProcess, ServerWhoseLogNobodyReadsServesAndEndsAsUsual) {
  server_.End(SIGTERM);
  int log[2];
  ASSERT_EQ(pipe2(log, O_CLOEXEC), 0);
  const int own = fcntl(STDERR_FILENO, F_DUPFD_CLOEXEC, 0);
  dup2(log[1], STDERR_FILENO);
  server_.Launch();
  dup2(own, STDERR_FILENO);
  for (const int fd : {own, log[0], log[1]}) close(fd);
  const std::string name = client().StartedJob({"fail", "b", "c"});  // of which its worker tells
  client().WaitFor(name, v1::JOB_STATE_FAILED);
  const int status = server_.End(SIGTERM);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0) << status;
}

TEST_F(ServiceProcess, KilledServerTakesItsWorkersAlongAndLosesNoJob) {
  const std::string name = client().StartedJob({"slow", "b", "c"}, 300);
  client().WaitFor(name, v1::JOB_STATE_RUNNING);
  const std::vector<pid_t> workers = Workers();
  ASSERT_EQ(workers.size(), 1u);
  server_.End(SIGKILL);
  EXPECT_TRUE(Eventually([&] {
    // A zombie that nobody has waited for yet is dead, too.
    std::string state = "gone";
    std::ifstream stat("/proc/" + std::to_string(workers[0]) + "/stat");
    for (int i = 0; i < 3; ++i) stat >> state;
    return state == "gone" || state == "Z";
  }));
  server_.Launch();
  client().WaitFor(name, v1::JOB_STATE_SUCCEEDED, 30);
  client().History(name);
}

TEST_F(ServiceProcess, KilledReaderOfFilesIsReplacedAndTheServerLivesOn) {
  const std::string first = client().StartedJob({"a", "b", "c"});
  const std::vector<pid_t> readers = Children("read-files");
  ASSERT_EQ(readers.size(), 1u);
  kill(readers[0], SIGKILL);
  // Files that are stored already are not read again.
  const std::string second = client().StartedJob({"a", "b", "c", "d"});
  client().WaitFor(first, v1::JOB_STATE_SUCCEEDED, 30);
  client().WaitFor(second, v1::JOB_STATE_SUCCEEDED, 30);
  ASSERT_EQ(Children("read-files").size(), 1u);
  EXPECT_NE(Children("read-files"), readers);
}

TEST_F(ServiceProcess, CommandsThatAreAskedToCheckOrPrintOnlyDoNothing) {
  server_.End(SIGTERM);
  const std::string target = dir_.path() + "/target", tokens = dir_.path() + "/tokens";
  const auto run = [&](const std::string& args) {
    const int status = std::system((std::string(FAKE_SERVER) + " " + args).c_str());
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  };
  const std::string move = "move --data " + dir_.path() + "/data --to-store sqlite://" + target +
                           " --to-blobs file://" + target + "-blobs";
  for (const char* instead : {" --check", " --print-config"}) {
    EXPECT_EQ(run(move + instead), 2);
    EXPECT_EQ(run("token alice --tokens " + tokens + instead), 2);
  }
  EXPECT_FALSE(std::filesystem::exists(target));
  EXPECT_FALSE(std::filesystem::exists(tokens));
  EXPECT_EQ(run(move), 0);
  EXPECT_TRUE(std::filesystem::exists(target));
}

TEST_F(ServiceProcess, SecondServerOnTheSameDataIsRefused) {
  const std::string log = dir_.path() + "/second.log";
  const int status = std::system(
      (std::string(FAKE_SERVER) + " --listen 127.0.0.1:0 --data " + dir_.path() + "/data 2> " + log)
          .c_str());
  EXPECT_NE(status, 0);
  std::ifstream file(log);
  const std::string text((std::istreambuf_iterator<char>(file)), {});
  EXPECT_THAT(text, HasSubstr("another litags-server uses"));
  EXPECT_THAT(text, HasSubstr(" (DATA_DIR_IN_USE)\n"));
}

}  // namespace
}  // namespace litags
