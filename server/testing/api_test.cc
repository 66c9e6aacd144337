#include <gmock/gmock.h>
#include <grpcpp/create_channel.h>
#include <gtest/gtest.h>

#include <atomic>
#include <functional>
#include <map>

#include "engine/core/sandbox.h"
#include "server/jobs/codec.h"
#include "server/testing/api_fixture.h"
#include "server/testing/eventually.h"
#include "server/testing/photos.h"
#include "server/worker/memory.h"

namespace litags {
namespace {

using ::testing::HasSubstr;

class JobsApi : public ApiTest {};

TEST_F(JobsApi, CreateIsIdempotentByRequestId) {
  v1::CreateJobRequest request;
  request.set_request_id("abc");
  v1::Job first, second;
  ASSERT_TRUE(client_.Create(request, &first).ok());
  ASSERT_TRUE(client_.Create(request, &second).ok());
  EXPECT_EQ(first.name(), second.name());
  request.set_display_name("other");
  EXPECT_REFUSED(client_.Create(request, &second), ALREADY_EXISTS, "REQUEST_ID_REUSED",
                 "request_id");
  request.set_request_id(std::string(65, 'x'));
  EXPECT_REFUSED(client_.Create(request, &second), INVALID_ARGUMENT, "REQUEST_ID_INVALID",
                 "request_id");
}

TEST_F(JobsApi, UnknownAndMalformedJobsAreRefusedByEveryCall) {
  v1::Job job;
  std::vector<v1::JobEvent> events;
  const std::string unknown = "jobs/0123456789abcdef";
  v1::RenderViewRequest render;
  render.set_name(unknown);
  v1::RenderedView view;
  for (const grpc::Status& status :
       {client_.Get(unknown, &job), client_.Start(unknown), client_.Cancel(unknown),
        client_.Resume(unknown), client_.Delete(unknown), client_.Watch(unknown, 0, &events),
        client_.Upload(unknown, {}), client_.Render(render, &view),
        client_.Query(unknown, {}, std::make_unique<v1::QueryUploadResponse>().get())}) {
    EXPECT_REFUSED(status, NOT_FOUND, "JOB_NOT_FOUND", "name");
    EXPECT_THAT(status.error_message(), HasSubstr(unknown));
  }
  for (const std::string name : {"", "0123456789abcdef", "jobs/", "jobs/../../etc", "jobs/A"}) {
    EXPECT_REFUSED(client_.Get(name, &job), INVALID_ARGUMENT, "JOB_NAME_INVALID", "name");
  }
}

// What each call answers in each state; "" is OK. Cancelling and resuming come before deleting, so
// that every call meets the state it is tested in: each gets a job of its own.
TEST_F(JobsApi, EveryCallInEveryStateGivesTheDocumentedCode) {
  using State = v1::JobState;
  const auto job_in = [&](State state) {
    const std::string name = NewJob(), id = name.substr(5);
    EXPECT_TRUE(client_
                    .Upload(name, {{"a.png", TestPng(64, 48, 1)},
                                   {"b.png", TestPng(64, 48, 2)},
                                   {"c.png", TestPng()}})
                    .ok());
    if (state == v1::JOB_STATE_UPLOADING) return name;
    EXPECT_TRUE(client_.Start(name).ok());
    if (state == v1::JOB_STATE_QUEUED) return name;
    const auto lease = leases_.Acquire("w" + id);
    EXPECT_TRUE(lease.ok() && lease->has_value());
    EXPECT_EQ((*lease)->job.id, id);
    absl::Status end;
    if (state == v1::JOB_STATE_SUCCEEDED) {
      end = leases_.Succeed(**lease, {}, {{kSceneFile, {"1/aa", 5}}});
    }
    if (state == v1::JOB_STATE_FAILED) end = leases_.Fail(**lease, absl::InternalError("x"));
    if (state == v1::JOB_STATE_CANCELLED) {
      EXPECT_TRUE(client_.Cancel(name).ok());
      end = leases_.Stopped(**lease);
    }
    EXPECT_TRUE(end.ok()) << end;
    return name;
  };
  struct Call {
    const char* what;
    std::function<grpc::Status(const std::string&)> call;
    std::map<State, std::string> refused;  // reason by state; all others are OK
  };
  const State uploading = v1::JOB_STATE_UPLOADING, queued = v1::JOB_STATE_QUEUED,
              running = v1::JOB_STATE_RUNNING, succeeded = v1::JOB_STATE_SUCCEEDED,
              failed = v1::JOB_STATE_FAILED, cancelled = v1::JOB_STATE_CANCELLED;
  const std::string closed = "JOB_NOT_UPLOADING", not_resumable = "JOB_NOT_RESUMABLE";
  const std::map<State, std::string> after_upload = {{queued, closed},
                                                     {running, closed},
                                                     {succeeded, closed},
                                                     {failed, closed},
                                                     {cancelled, closed}};
  std::map<State, std::string> takes_no_files = after_upload;
  takes_no_files.erase(failed);
  v1::Job job;
  v1::QueryUploadResponse query;
  const std::vector<Call> calls = {
      {"GetJob", [&](auto& name) { return client_.Get(name, &job); }, {}},
      {"QueryUpload",
       [&](auto& name) {
         return client_.Query(name, {{"c.png", "x"}}, &query);
       },
       takes_no_files},
      {"UploadImages",
       [&](auto& name) {
         return client_.Upload(name, {{"c.png", TestPng(64, 48, 3)}});
       },
       takes_no_files},
      {"StartJob", [&](auto& name) { return client_.Start(name); }, after_upload},
      {"CancelJob",
       [&](auto& name) { return client_.Cancel(name); },
       {{succeeded, "JOB_ALREADY_DONE"}, {failed, "JOB_ALREADY_DONE"}}},
      {"ResumeJob",
       [&](auto& name) { return client_.Resume(name); },
       {{uploading, not_resumable},
        {queued, not_resumable},
        {running, not_resumable},
        {succeeded, not_resumable}}},
      {"DeleteJob", [&](auto& name) { return client_.Delete(name); }, {{running, "JOB_RUNNING"}}},
  };
  for (const State state : {uploading, running, succeeded, failed, cancelled, queued}) {
    for (const Call& call : calls) {
      SCOPED_TRACE(std::string(call.what) + " in " + v1::JobState_Name(state));
      const std::string name = job_in(state);
      const grpc::Status status = call.call(name);
      const auto refused = call.refused.find(state);
      if (refused == call.refused.end()) {
        EXPECT_TRUE(status.ok()) << status.error_message();
      } else {
        EXPECT_EQ(status.error_code(), grpc::FAILED_PRECONDITION);
        EXPECT_EQ(DetailOf(status).reason, refused->second);
      }
      // Out of the way of the jobs that follow in the queue; NOT_FOUND after DeleteJob.
      store_->Update(name.substr(5), [](JobTransaction& t) { return t.Remove(); })
          .status()
          .IgnoreError();
    }
  }
}

TEST_F(JobsApi, PolicyReachesTheJobAndIsChecked) {
  v1::CreateJobRequest request;
  request.mutable_policy()->set_priority(7);
  request.mutable_policy()->mutable_max_run_time()->set_seconds(60);
  request.mutable_policy()->set_max_memory_bytes(int64_t{1} << 30);
  request.mutable_policy()->mutable_retention()->set_seconds(3600);
  request.mutable_policy()->set_min_cores(4);
  request.mutable_policy()->set_min_memory_bytes(int64_t{1} << 29);
  request.mutable_policy()->add_worker_labels("avx512");
  v1::Job job;
  ASSERT_TRUE(client_.Create(request, &job).ok());
  EXPECT_EQ(job.policy().SerializeAsString(), request.policy().SerializeAsString());
  request.mutable_policy()->set_priority(101);
  EXPECT_REFUSED(client_.Create(request, &job), INVALID_ARGUMENT, "POLICY_OUT_OF_RANGE",
                 "policy.priority");
}

TEST_F(JobsApi, WatchFollowsAJobFromCreationToItsEnd) {
  StartWorker();
  const std::string name = client_.StartedJob({"a", "b", "c"});
  std::vector<v1::JobEvent> events;
  const grpc::Status status = client_.Watch(name, 0, &events, SIZE_MAX, /*previews=*/true);
  ASSERT_TRUE(status.ok()) << status.error_message();
  std::vector<v1::JobState> states;
  int previews = 0, snapshots = 0;
  for (size_t i = 0; i < events.size(); ++i) {
    EXPECT_EQ(events[i].number(), static_cast<int64_t>(i + 1));
    if (events[i].has_state_change()) states.push_back(events[i].state_change().state());
    previews += !events[i].progress().preview_png().empty();
    snapshots += events[i].has_snapshot();
  }
  EXPECT_THAT(states, ::testing::ElementsAre(v1::JOB_STATE_UPLOADING, v1::JOB_STATE_QUEUED,
                                             v1::JOB_STATE_RUNNING, v1::JOB_STATE_SUCCEEDED));
  EXPECT_GT(previews, 0);
  EXPECT_GT(snapshots, 0);
  v1::Job job;
  ASSERT_TRUE(client_.Get(name, &job).ok());
  EXPECT_EQ(job.last_event(), static_cast<int64_t>(events.size()));
  EXPECT_EQ(job.report().photos(), 3);
  EXPECT_FALSE(job.report().has_psnr_holdout());
  EXPECT_FALSE(job.report().has_ssim_holdout());
  EXPECT_EQ(job.snapshot_iteration(), 40);
}

TEST_F(JobsApi, WatchResumedAfterEachEventHasNoGapAndNoDouble) {
  StartWorker();
  const std::string name = client_.StartedJob({"a", "b", "c"});
  std::vector<v1::JobEvent> all;
  grpc::Status status;
  do {  // one event per stream while the job runs
    const size_t before = all.size();
    std::vector<v1::JobEvent> next;
    status = client_.Watch(name, static_cast<int64_t>(before), &next, 1);
    all.insert(all.end(), next.begin(), next.end());
  } while (!status.ok() && status.error_code() == grpc::CANCELLED && all.size() < 1000);
  EXPECT_TRUE(status.ok()) << status.error_message();
  for (size_t i = 0; i < all.size(); ++i) {
    EXPECT_EQ(all[i].number(), static_cast<int64_t>(i + 1));
  }
  std::vector<v1::JobEvent> at_once;
  ASSERT_TRUE(client_.Watch(name, 0, &at_once).ok());
  ASSERT_EQ(all.size(), at_once.size());
  std::vector<v1::JobEvent> none;
  EXPECT_REFUSED(client_.Watch(name, static_cast<int64_t>(all.size()) + 1, &none), OUT_OF_RANGE,
                 "EVENT_NOT_YET", "after_event");
  EXPECT_REFUSED(client_.Watch(name, -1, &none), INVALID_ARGUMENT, "EVENT_NUMBER_INVALID",
                 "after_event");
  EXPECT_TRUE(none.empty());
}

// 20 MB of history and eight readers that read nothing: held for each, it would be 160 MB.
TEST_F(JobsApi, ReadersThatDoNotReadHoldNoMemoryAndLoseNothing) {
  constexpr int kEvents = 5000, kReaders = 8;
  const std::string name = NewJob();
  ProgressRecord record;
  record.progress.message = std::string(4000, 'x');
  const std::string payload = Encode(record);
  ASSERT_TRUE(
      store_
          ->Update(name.substr(5),
                   [&](JobTransaction& job) -> absl::Status {
                     for (int i = 0; i < kEvents; ++i) {
                       LITAGS_RETURN_IF_ERROR(job.AddEvent({0, 1, EventKind::kProgress, payload}));
                     }
                     return absl::OkStatus();
                   })
          .ok());
  ServerOptions options = Options();
  options.listen = "127.0.0.1:0";
  const auto server = *StartServer(options, &jobs_, engine_.get());
  const auto channel = grpc::CreateChannel("127.0.0.1:" + std::to_string(server->port()),
                                           grpc::InsecureChannelCredentials());
  TestClient client(channel);
  v1::WatchJobRequest request;
  request.set_name(name);
  const int64_t before = ResidentBytesWithChildren();
  std::vector<std::unique_ptr<grpc::ClientContext>> calls;
  std::vector<std::unique_ptr<grpc::ClientReader<v1::JobEvent>>> readers;
  for (int i = 0; i < kReaders; ++i) {
    calls.push_back(std::make_unique<grpc::ClientContext>());
    readers.push_back(client.jobs->WatchJob(calls.back().get(), request));
    v1::JobEvent event;
    ASSERT_TRUE(readers.back()->Read(&event));
  }
  std::this_thread::sleep_for(std::chrono::milliseconds(500));  // time to send all it would
  // Half of what all events would take; windows of connections are some 40 MB.
  if (!kBuiltWithSanitizer) {
    EXPECT_LT(ResidentBytesWithChildren() - before, int64_t{kReaders} * kEvents * 4000 / 2);
  }
  v1::JobEvent event;
  for (int64_t number = 2; number <= kEvents + 1; ++number) {  // "created" is the first
    ASSERT_TRUE(readers[0]->Read(&event));
    ASSERT_EQ(event.number(), number);
  }
  for (const auto& call : calls) call->TryCancel();
  for (const auto& reader : readers) (void)reader->Finish();
}

TEST_F(JobsApi, WatchEndsWhenTheJobIsDeletedAndWhenTheServerStops) {
  const std::string deleted = NewJob(), kept = NewJob();
  std::atomic<int> a = 0, b = 0;  // events
  const auto watch = [&](const std::string& name, std::atomic<int>* events) {
    grpc::ClientContext call;
    v1::WatchJobRequest request;
    request.set_name(name);
    const auto reader = client_.jobs->WatchJob(&call, request);
    for (v1::JobEvent event; reader->Read(&event);) ++*events;
    return reader->Finish();
  };
  grpc::Status status_a, status_b;
  std::thread watch_a([&] { status_a = watch(deleted, &a); });
  std::thread watch_b([&] { status_b = watch(kept, &b); });
  EXPECT_TRUE(Eventually([&] { return a > 0 && b > 0; }));
  EXPECT_TRUE(client_.Delete(deleted).ok());
  watch_a.join();
  EXPECT_REFUSED(status_a, NOT_FOUND, "JOB_NOT_FOUND", "name");
  server_->Shutdown();
  watch_b.join();
  EXPECT_REFUSED(status_b, UNAVAILABLE, "SHUTTING_DOWN", "");
  EXPECT_EQ(b.load(), 1);
}

TEST_F(JobsApi, FailureOfTheEngineArrivesWithCodeReasonAndField) {
  StartWorker();
  const std::string name = client_.StartedJob({"fail", "b", "c"});
  const v1::Job job = client_.WaitFor(name, v1::JOB_STATE_FAILED);
  EXPECT_EQ(job.error().code(), grpc::FAILED_PRECONDITION);
  EXPECT_EQ(job.error().detail().reason(), "SFM_TOO_FEW_VIEWS");
  EXPECT_THAT(job.error().message(), HasSubstr("take photos that overlap more"));
}

TEST_F(JobsApi, RunningJobIsCancelledAndResumesFromItsCheckpoint) {
  StartWorker();
  const std::string name = client_.StartedJob({"slow", "b", "c"}, 500);
  std::vector<v1::JobEvent> events;
  do {  // until a snapshot says that a checkpoint is there too
    client_.Watch(name, static_cast<int64_t>(events.size()), &events, 1);
  } while (!events.back().has_snapshot());
  EXPECT_REFUSED(client_.Delete(name), FAILED_PRECONDITION, "JOB_RUNNING", "name");
  ASSERT_TRUE(client_.Cancel(name).ok());
  client_.WaitFor(name, v1::JOB_STATE_CANCELLED);
  ASSERT_TRUE(client_.Resume(name).ok());
  v1::Job job;
  do {
    ASSERT_TRUE(client_.Get(name, &job).ok());
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  } while (job.state() == v1::JOB_STATE_QUEUED || job.state() == v1::JOB_STATE_RUNNING);
  ASSERT_EQ(job.state(), v1::JOB_STATE_SUCCEEDED);
  ASSERT_EQ(job.report().notes_size(), 1);
  EXPECT_THAT(job.report().notes(0), HasSubstr("resumed at iteration"));
  EXPECT_REFUSED(client_.Cancel(name), FAILED_PRECONDITION, "JOB_ALREADY_DONE", "name");
  EXPECT_REFUSED(client_.Resume(name), FAILED_PRECONDITION, "JOB_NOT_RESUMABLE", "name");
  EXPECT_TRUE(client_.Delete(name).ok());
}

TEST_F(JobsApi, AResumeThatIsRepeatedIsToldTheStateOfTheJob) {
  v1::ResumeJobRequest request;
  request.set_name(client_.StartedJob({"a", "b", "c"}, 30));  // nobody takes it
  ASSERT_TRUE(client_.Cancel(request.name()).ok());
  v1::Job job;
  ASSERT_TRUE(client_.Get(request.name(), &job).ok());
  *request.mutable_options() = job.options();
  request.mutable_options()->set_iterations(50);
  const grpc::Status first = client_.Resume(request);
  ASSERT_TRUE(first.ok()) << first.error_message();
  EXPECT_REFUSED(client_.Resume(request), FAILED_PRECONDITION, "JOB_NOT_RESUMABLE", "name");
}

TEST_F(JobsApi, ASucceededJobIsTrainedFurther) {
  StartWorker();
  v1::ResumeJobRequest request;
  request.set_name(client_.StartedJob({"a", "b", "c"}, 30));
  client_.WaitFor(request.name(), v1::JOB_STATE_SUCCEEDED);
  request.mutable_options()->set_iterations(29);
  EXPECT_REFUSED(client_.Resume(request), INVALID_ARGUMENT, "ITERATIONS_REDUCED",
                 "options.iterations");
  request.mutable_options()->set_iterations(30);
  EXPECT_REFUSED(client_.Resume(request), FAILED_PRECONDITION, "JOB_NOT_RESUMABLE", "name");
  request.mutable_options()->set_iterations(50);
  request.mutable_options()->set_sh_degree(1);
  EXPECT_REFUSED(client_.Resume(request), INVALID_ARGUMENT, "OPTION_NOT_RESUMABLE",
                 "options.sh_degree");
  request.mutable_options()->set_sh_degree(9);
  EXPECT_EQ(DetailOf(client_.Resume(request)).field, "options.sh_degree");
  request.mutable_options()->clear_sh_degree();
  request.mutable_policy()->set_priority(101);
  EXPECT_REFUSED(client_.Resume(request), INVALID_ARGUMENT, "POLICY_OUT_OF_RANGE",
                 "policy.priority");
  request.mutable_policy()->set_priority(3);
  v1::Job job;
  ASSERT_TRUE(client_.Resume(request, &job).ok());
  EXPECT_EQ(job.report().iterations(), 30);  // of the scene that is finished
  EXPECT_EQ(job.snapshot_iteration(), 30);   // can be seen meanwhile
  job = client_.WaitFor(request.name(), v1::JOB_STATE_SUCCEEDED);
  EXPECT_EQ(job.report().iterations(), 50);
  EXPECT_EQ(job.report().notes(0), "resumed at iteration 30");
  EXPECT_EQ(job.snapshot_iteration(), 50);
  EXPECT_EQ(job.options().iterations(), 50);
  EXPECT_EQ(job.options().schedule_iterations(), 30);
  EXPECT_EQ(job.policy().priority(), 3);
}

// What a picture of the job shows: the iteration of its scene.
int ShownIteration(TestClient& client, const std::string& job) {
  v1::RenderViewRequest request;
  request.set_name(job);
  request.mutable_pose()->set_camera("a.png");
  v1::RenderedView view;
  const grpc::Status status = client.Render(request, &view);
  EXPECT_TRUE(status.ok()) << status.error_message();
  return view.iteration();
}

TEST_F(JobsApi, AFinishedSceneOutlivesAResumeThatIsCancelled) {
  StartWorker();
  v1::ResumeJobRequest request;
  request.set_name(client_.StartedJob({"a", "b", "c"}, 30));
  client_.WaitFor(request.name(), v1::JOB_STATE_SUCCEEDED);
  request.mutable_options()->set_iterations(100'000);
  v1::Job job;
  ASSERT_TRUE(client_.Resume(request, &job).ok());
  for (int i = 0; i < 2000 && job.snapshot_iteration() < 50; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
    ASSERT_TRUE(client_.Get(request.name(), &job).ok());
  }
  EXPECT_GT(ShownIteration(client_, request.name()), 30);  // trained further, as far as it is
  ASSERT_TRUE(client_.Cancel(request.name()).ok());
  job = client_.WaitFor(request.name(), v1::JOB_STATE_CANCELLED);
  EXPECT_EQ(job.report().iterations(), 30);
  EXPECT_EQ(job.snapshot_iteration(), 30);
  EXPECT_EQ(ShownIteration(client_, request.name()), 30);
  std::vector<v1::JobEvent> events;
  ASSERT_TRUE(client_.Watch(request.name(), job.last_event() - 2, &events).ok());
  ASSERT_EQ(events.size(), 2u);
  EXPECT_EQ(events[0].snapshot().iteration(), 30);
  EXPECT_THAT(events[1].state_change().message(),
              HasSubstr("finished scene of 30 iterations stays"));
}

}  // namespace
}  // namespace litags
