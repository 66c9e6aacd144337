// What the server holds for clients that read slowly, or not at all, over real sockets.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <filesystem>
#include <thread>
#include <utility>
#include <vector>

#include "server/testing/eventually.h"
#include "server/testing/photos.h"
#include "server/testing/slow_client_fixture.h"

namespace litags {
namespace {

using ::testing::HasSubstr;

// Counts the scenes that are in memory.
class CountingEngine : public Engine {
 public:
  explicit CountingEngine(Engine* engine) : engine_(engine) {}
  int scenes() const { return *scenes_; }

  absl::StatusOr<ReconstructReport> Reconstruct(const ReconstructInput& input,
                                                const ReconstructOptions& options,
                                                const CancelToken& cancel,
                                                ReconstructObserver* observer) override {
    return engine_->Reconstruct(input, options, cancel, observer);
  }
  absl::StatusOr<std::shared_ptr<const Scene>> LoadScene(const std::string& path) override {
    LITAGS_ASSIGN_OR_RETURN(auto scene, engine_->LoadScene(path));
    ++*scenes_;
    const Scene* const held = scene.get();
    return std::shared_ptr<const Scene>(
        held, [scene = std::move(scene), scenes = scenes_](const Scene*) { --*scenes; });
  }

 private:
  Engine* const engine_;
  const std::shared_ptr<std::atomic<int>> scenes_ = std::make_shared<std::atomic<int>>(0);
};

class HeldForClients : public SlowClientTest {
 protected:
  int SnapshotOf(const std::string& job) {
    v1::Job now;
    EXPECT_TRUE(client_.Get(job, &now).ok());
    return now.has_snapshot_iteration() ? now.snapshot_iteration() : -1;
  }

  // A job that trains for as long as the test takes, and makes a snapshot every 0.1 s.
  std::string TrainingJob() {
    v1::CreateJobRequest request;
    request.mutable_options()->set_iterations(100'000);
    request.mutable_options()->set_preview_every(5);
    v1::Job job;
    EXPECT_TRUE(client_.Create(request, &job).ok());
    EXPECT_TRUE(client_
                    .Upload(job.name(), {{"slow.png", TestPng()},
                                         {"b.png", TestPng(64, 48, 1)},
                                         {"c.png", TestPng(64, 48, 2)}})
                    .ok());
    EXPECT_TRUE(client_.Start(job.name()).ok());
    return job.name();
  }
};

TEST_F(HeldForClients, PathsThatAreReadSlowlyKeepNoOldSnapshots) {
  CountingEngine engine(engine_.get());
  ServerOptions options = Options();
  options.scene_cache_bytes = 1;
  Serve(options, &engine);
  StartWorker();
  const std::string job = TrainingJob();
  constexpr int kPaths = 6, kFrames = 20;
  std::vector<std::unique_ptr<grpc::ClientContext>> calls;
  std::vector<PathReader> paths;
  v1::RenderPathResponse frame;
  int last = -1;
  for (int i = 0; i < kPaths; ++i) {
    ASSERT_TRUE(Eventually([&] { return SnapshotOf(job) > last; }));
    last = SnapshotOf(job);
    calls.push_back(std::make_unique<grpc::ClientContext>());
    paths.push_back(OpenPath(calls.back().get(), job, kFrames));
    ASSERT_TRUE(paths.back()->Read(&frame));
  }
  EXPECT_TRUE(Eventually([&] { return engine.scenes() <= 1; })) << engine.scenes();
  // The first path goes on with newer snapshots, to its end.
  std::vector<int> iterations;
  while (paths[0]->Read(&frame)) iterations.push_back(frame.view().iteration());
  EXPECT_EQ(iterations.size(), static_cast<size_t>(kFrames - 1));
  EXPECT_TRUE(std::is_sorted(iterations.begin(), iterations.end()));
  EXPECT_GE(iterations.back(), last);
  for (const auto& call : calls) call->TryCancel();
  for (const auto& path : paths) path->Finish();
  server_->Shutdown();
}

TEST_F(HeldForClients, APathStaysOnItsSnapshotWhileThereIsRoom) {
  Serve(Options(), engine_.get());
  StartWorker();
  const std::string job = TrainingJob();
  ASSERT_TRUE(Eventually([&] { return SnapshotOf(job) >= 0; }));
  grpc::ClientContext call;
  const PathReader path = OpenPath(&call, job, 20);
  v1::RenderPathResponse frame;
  ASSERT_TRUE(path->Read(&frame));
  const int first = frame.view().iteration();
  ASSERT_TRUE(Eventually([&] { return SnapshotOf(job) > first; }));
  v1::RenderViewRequest newest;
  newest.set_name(job);
  newest.mutable_pose()->set_camera("b.png");
  v1::RenderedView view;
  ASSERT_TRUE(client_.Render(newest, &view).ok());
  EXPECT_GT(view.iteration(), first);
  while (path->Read(&frame)) EXPECT_EQ(frame.view().iteration(), first);
  EXPECT_TRUE(path->Finish().ok());
}

// Exports that this process, the server, has on disk.
int OpenExports() {
  int exports = 0;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator("/proc/self/fd")) {
    const auto file = std::filesystem::read_symlink(entry.path(), error);
    if (!error && file.string().find("/export-") != std::string::npos) ++exports;
  }
  return exports;
}

TEST_F(HeldForClients, ExportsWaitForDiskSpaceAndThenGoOn) {
  StartWorker();
  const std::string job = client_.StartedJob({"a", "b", "c"}, 10);
  client_.WaitFor(job, v1::JOB_STATE_SUCCEEDED);
  ServerOptions options = Options();
  options.answers.max_export_bytes = 1'000'000;  // an export has 600 kB, and a client half of it
  options.render_threads = 1;
  Serve(options, engine_.get());
  v1::ExportModelRequest request;
  request.set_name(job);
  constexpr int kExports = 4;
  std::vector<std::unique_ptr<grpc::ClientContext>> calls;
  std::vector<std::unique_ptr<grpc::ClientReader<v1::ExportModelResponse>>> exports;
  for (int i = 0; i < kExports; ++i) {
    calls.push_back(std::make_unique<grpc::ClientContext>());
    exports.push_back(slow_client_.model->ExportModel(calls.back().get(), request));
  }
  ASSERT_TRUE(Eventually([] { return OpenExports() > 0; }));
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  EXPECT_EQ(OpenExports(), 1);
  std::vector<std::thread> readers;
  for (const auto& reader : exports) {
    readers.emplace_back([&reader] {
      size_t bytes = 0;
      for (v1::ExportModelResponse part; reader->Read(&part);) bytes += part.chunk().size();
      EXPECT_GT(bytes, 600'000u);
      EXPECT_TRUE(reader->Finish().ok());
    });
  }
  for (std::thread& reader : readers) reader.join();
}

TEST_F(HeldForClients, AnExportThatIsNotReadIsCutOffAndItsDiskSpaceFreed) {
  StartWorker();
  const std::string job = client_.StartedJob({"a", "b", "c"}, 10);
  client_.WaitFor(job, v1::JOB_STATE_SUCCEEDED);
  ServerOptions options = Options();
  options.answers.max_unread_seconds = 0.3;
  Serve(options, engine_.get());
  v1::ExportModelRequest request;
  request.set_name(job);
  grpc::ClientContext call;
  const auto reader = slow_client_.model->ExportModel(&call, request);
  reader->WaitForInitialMetadata();  // the export has begun
  EXPECT_TRUE(Eventually([] { return OpenExports() == 0; }));
  for (v1::ExportModelResponse part; reader->Read(&part);) {
  }
  const grpc::Status status = reader->Finish();
  EXPECT_EQ(status.error_code(), grpc::UNAVAILABLE) << status.error_message();
}

// Events with previews of 1 MB, twice in the server, and room for 4 MB, of which one client may
// have half.
class HeldPreviews : public HeldForClients {
 protected:
  void Serve(double max_unread_seconds) {
    ServerOptions options = Options();
    options.answers.max_unread_seconds = max_unread_seconds;
    options.answers.max_unread_bytes = 4'000'000;
    HeldForClients::Serve(options, engine_.get());
    job_ = client_.StartedJob({"a", "b", "c"});
    const Lease lease = **leases_.Acquire("worker");
    Progress progress;
    progress.preview_png.assign(1'000'000, 'x');
    for (progress.iteration = 1; progress.iteration <= 3; ++progress.iteration) {
      ASSERT_TRUE(leases_.AddProgress(lease, progress).ok());
    }
  }

  std::unique_ptr<grpc::ClientReader<v1::JobEvent>> SlowWatch(grpc::ClientContext* call) {
    call->set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(30));
    v1::WatchJobRequest request;
    request.set_name(job_);
    request.set_include_previews(true);
    return slow_client_.jobs->WatchJob(call, request);
  }

  // Whether there is no room for pictures.
  bool IsFull() {
    v1::RenderViewRequest request;
    request.set_name(job_);
    request.mutable_pose()->set_camera("b.png");
    v1::RenderedView view;
    return DetailOf(client_.Render(request, &view)).reason == "RENDER_QUEUE_FULL";
  }

  std::string job_;
};

TEST_F(HeldPreviews, AWatcherThatDoesNotReadIsCutOffAndItsMemoryFreed) {
  Serve(/*max_unread_seconds=*/3);
  grpc::ClientContext call;
  const auto watch = SlowWatch(&call);
  EXPECT_TRUE(Eventually([&] { return IsFull(); }));
  EXPECT_TRUE(Eventually([&] { return !IsFull(); }));
  for (v1::JobEvent event; watch->Read(&event);) {
  }
  const grpc::Status status = watch->Finish();
  EXPECT_EQ(status.error_code(), grpc::UNAVAILABLE) << status.error_message();
  EXPECT_THAT(status.error_message(), HasSubstr("not read in time"));
}

TEST_F(HeldPreviews, EventsComeWithoutPreviewsWhileTooMuchIsUnread) {
  Serve(/*max_unread_seconds=*/30);
  const auto previews = [&] {
    std::vector<v1::JobEvent> events;
    client_.Watch(job_, 0, &events, /*at_most=*/6, /*previews=*/true);
    EXPECT_EQ(events.size(), 6u);  // created, started, leased, and the three
    return std::count_if(events.begin(), events.end(), [](const v1::JobEvent& event) {
      return !event.progress().preview_png().empty();
    });
  };
  // On a busy machine a client may read too slowly for one of them.
  EXPECT_TRUE(Eventually([&] { return previews() == 3; }));
  std::unique_ptr<grpc::ClientContext> call;
  std::unique_ptr<grpc::ClientReader<v1::JobEvent>> watch;
  // What the reader before held may still count when the slow one begins, which has no previews
  // then.
  const auto begin = [&] {
    if (watch != nullptr) {
      call->TryCancel();
      watch->Finish();
    }
    call = std::make_unique<grpc::ClientContext>();
    watch = SlowWatch(call.get());
    for (int i = 0; i < 50 && !IsFull(); ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    return IsFull();
  };
  ASSERT_TRUE(Eventually(begin));
  EXPECT_EQ(previews(), 0);
  call->TryCancel();
  watch->Finish();
}

}  // namespace
}  // namespace litags
