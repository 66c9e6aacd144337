// Calls that look after jobs: lists, files, changes, logs, and what the server says of itself.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <set>

#include "engine/core/error.h"
#include "server/api/convert.h"
#include "server/testing/api_fixture.h"
#include "server/testing/forwarding_job_store.h"
#include "server/testing/photos.h"

namespace litags {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

class ManageApi : public ApiTest {
 protected:
  std::string Named(const std::string& display_name, std::map<std::string, std::string> labels) {
    v1::CreateJobRequest request;
    request.set_display_name(display_name);
    request.mutable_labels()->insert(labels.begin(), labels.end());
    v1::Job job;
    EXPECT_TRUE(client_.Create(request, &job).ok());
    return job.name();
  }

  // Names of the jobs of all pages.
  std::vector<std::string> Listed(v1::ListJobsRequest request) {
    std::vector<std::string> names;
    for (;;) {
      v1::ListJobsResponse page;
      grpc::ClientContext context;
      const grpc::Status status = client_.jobs->ListJobs(&context, request, &page);
      EXPECT_TRUE(status.ok()) << status.error_message();
      for (const v1::Job& job : page.jobs()) names.push_back(job.display_name());
      if (page.next_page_token().empty()) return names;
      request.set_page_token(page.next_page_token());
    }
  }

  template <typename Request, typename Response>
  grpc::Status Call(grpc::Status (v1::ReconstructionService::Stub::*method)(grpc::ClientContext*,
                                                                            const Request&,
                                                                            Response*),
                    const Request& request, Response* response) {
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(60));
    return ((*client_.jobs).*method)(&context, request, response);
  }

  grpc::Status Update(const v1::UpdateJobRequest& request, v1::Job* job) {
    return Call(&v1::ReconstructionService::Stub::UpdateJob, request, job);
  }

  std::vector<v1::LogEntry> Log(const v1::GetLogRequest& request, grpc::Status* status) {
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(60));
    const auto reader = client_.jobs->GetLog(&context, request);
    std::vector<v1::LogEntry> entries;
    for (v1::LogEntry entry; reader->Read(&entry);) entries.push_back(entry);
    *status = reader->Finish();
    return entries;
  }
};

TEST_F(ManageApi, ListPagesThroughAllJobsNewestFirst) {
  std::vector<std::string> made;
  for (int i = 0; i < 5; ++i) made.push_back(NewJob());
  std::set<std::string> seen;
  v1::ListJobsRequest request;
  request.set_page_size(2);
  int pages = 0;
  do {
    grpc::ClientContext context;
    v1::ListJobsResponse response;
    ASSERT_TRUE(client_.jobs->ListJobs(&context, request, &response).ok());
    for (const v1::Job& job : response.jobs()) EXPECT_TRUE(seen.insert(job.name()).second);
    request.set_page_token(response.next_page_token());
    ++pages;
  } while (!request.page_token().empty());
  EXPECT_EQ(pages, 3);
  EXPECT_EQ(seen, std::set<std::string>(made.begin(), made.end()));

  const auto list = [&](int size, const std::string& token) {
    grpc::ClientContext context;
    v1::ListJobsResponse response;
    request.set_page_size(size);
    request.set_page_token(token);
    return client_.jobs->ListJobs(&context, request, &response);
  };
  EXPECT_REFUSED(list(2, "junk"), INVALID_ARGUMENT, "PAGE_TOKEN_INVALID", "page_token");
  EXPECT_REFUSED(list(-1, ""), INVALID_ARGUMENT, "PAGE_SIZE_INVALID", "page_size");
}

TEST_F(ManageApi, AFilterLetsThroughWhatItNames) {
  Named("a", {{"site", "north"}});
  Named("b", {{"site", "south"}});
  const std::string c = Named("c", {{"site", "north"}});
  ASSERT_TRUE(client_.Cancel(c).ok());
  v1::ListJobsRequest request;
  request.set_filter("labels.site = north");
  EXPECT_THAT(Listed(request), ElementsAre("c", "a"));
  request.set_page_size(1);
  EXPECT_THAT(Listed(request), ElementsAre("c", "a"));
  request.set_order_by("create_time");
  EXPECT_THAT(Listed(request), ElementsAre("a", "c"));
  request.set_filter("labels.site = north AND state = UPLOADING");
  EXPECT_THAT(Listed(request), ElementsAre("a"));
}

TEST_F(ManageApi, ALongListIsReadInPagesWhateverTheFilter) {
  std::vector<std::string> wanted;
  for (int i = 0; i < 450; ++i) {
    const bool kept = i % 90 == 7;
    Named(absl::StrCat("job", i), {{"kept", kept ? "yes" : "no"}});
    if (kept) wanted.push_back(absl::StrCat("job", i));
  }
  v1::ListJobsRequest request;
  request.set_filter("labels.kept = yes");
  request.set_order_by("create_time");
  request.set_page_size(2);
  EXPECT_THAT(Listed(request), ::testing::ElementsAreArray(wanted));
  request.set_filter("");
  request.set_page_size(300);
  EXPECT_EQ(Listed(request).size(), 450u);
}

TEST_F(ManageApi, WhatNoListTakesIsRefused) {
  Named("a", {});
  Named("b", {});
  v1::ListJobsResponse page;
  const auto list = [&](const v1::ListJobsRequest& request) {
    return Call(&v1::ReconstructionService::Stub::ListJobs, request, &page);
  };
  v1::ListJobsRequest request;
  request.set_filter("colour = red");
  EXPECT_REFUSED(list(request), INVALID_ARGUMENT, "FILTER_INVALID", "filter");
  request.set_filter("");
  request.set_order_by("display_name");
  EXPECT_REFUSED(list(request), INVALID_ARGUMENT, "ORDER_INVALID", "order_by");
  request.set_order_by("");
  request.set_page_size(1);
  ASSERT_TRUE(list(request).ok());
  request.set_page_token(page.next_page_token());
  request.set_order_by("create_time");
  EXPECT_REFUSED(list(request), INVALID_ARGUMENT, "PAGE_TOKEN_INVALID", "page_token");
}

TEST_F(ManageApi, FilesAreListedPageByPageAndDeleted) {
  const std::string job = NewJob();
  const std::string photo = TestPng(64, 48, 1);
  ASSERT_TRUE(client_
                  .Upload(job, {{"a-1.png", photo},
                                {"b.png", TestPng(64, 48, 2)},
                                {"c.png", TestPng(64, 48, 3)}})
                  .ok());
  v1::ListFilesRequest request;
  request.set_name(job);
  request.set_page_size(2);
  v1::ListFilesResponse page;
  const auto list = [&] {
    page.Clear();
    return Call(&v1::ReconstructionService::Stub::ListFiles, request, &page);
  };
  ASSERT_TRUE(list().ok());
  ASSERT_EQ(page.files_size(), 2);
  EXPECT_EQ(page.files(0).file_name(), "a-1.png");
  EXPECT_EQ(page.files(0).size_bytes(), static_cast<int64_t>(photo.size()));
  EXPECT_EQ(page.files(0).sha256().size(), 32u);
  EXPECT_EQ(page.files(0).width(), 64);
  EXPECT_EQ(page.files(0).role(), v1::FILE_ROLE_PHOTO);
  request.set_page_token(page.next_page_token());
  ASSERT_TRUE(list().ok());
  ASSERT_EQ(page.files_size(), 1);
  EXPECT_EQ(page.files(0).file_name(), "c.png");
  EXPECT_EQ(page.next_page_token(), "");
  request.set_page_token("1-xyz");
  EXPECT_REFUSED(list(), INVALID_ARGUMENT, "PAGE_TOKEN_INVALID", "page_token");
  request.set_page_token("");
  request.set_page_size(-1);
  EXPECT_REFUSED(list(), INVALID_ARGUMENT, "PAGE_SIZE_INVALID", "page_size");
  request.set_page_size(1'000'000);  // the most there may be
  EXPECT_TRUE(list().ok());

  v1::DeleteFileRequest remove;
  remove.set_name(job);
  remove.set_file_name("b.png");
  google::protobuf::Empty empty;
  const auto erase = [&] {
    return Call(&v1::ReconstructionService::Stub::DeleteFile, remove, &empty);
  };
  ASSERT_TRUE(erase().ok());
  EXPECT_REFUSED(erase(), NOT_FOUND, "JOB_FILE_NOT_FOUND", "file_name");
  remove.set_allow_missing(true);
  EXPECT_TRUE(erase().ok());
  v1::Job left;
  ASSERT_TRUE(client_.Get(job, &left).ok());
  EXPECT_EQ(left.photos(), 2);
}

TEST_F(ManageApi, AnUpdateTakesWhatItsMaskNames) {
  v1::UpdateJobRequest request;
  request.mutable_job()->set_name(Named("before", {{"a", "1"}, {"b", "2"}}));
  request.mutable_job()->set_display_name("after");
  (*request.mutable_job()->mutable_labels())["c"] = "3";
  request.mutable_job()->mutable_policy()->set_priority(-7);
  request.mutable_job()->mutable_policy()->mutable_retention()->set_seconds(60);
  v1::Job job;
  EXPECT_REFUSED(Update(request, &job), INVALID_ARGUMENT, "UPDATE_MASK_EMPTY", "update_mask");
  for (const char* path : {"state", "options.iterations", "labels."}) {
    request.mutable_update_mask()->clear_paths();
    request.mutable_update_mask()->add_paths(path);
    EXPECT_REFUSED(Update(request, &job), INVALID_ARGUMENT, "UPDATE_MASK_INVALID", "update_mask");
  }
  request.mutable_update_mask()->clear_paths();
  request.mutable_job()->mutable_policy()->add_worker_labels("site-b");
  for (const char* path :
       {"labels.a", "labels.c", "policy.priority", "policy.retention", "policy.worker_labels"}) {
    request.mutable_update_mask()->add_paths(path);
  }
  const grpc::Status status = Update(request, &job);
  ASSERT_TRUE(status.ok()) << status.error_message();
  EXPECT_EQ(job.display_name(), "before");
  const std::map<std::string, std::string> labels(job.labels().begin(), job.labels().end());
  EXPECT_EQ(labels, (std::map<std::string, std::string>{{"b", "2"}, {"c", "3"}}));
  EXPECT_EQ(job.policy().priority(), -7);
  EXPECT_EQ(job.policy().retention().seconds(), 60);
  EXPECT_THAT(job.policy().worker_labels(), ElementsAre("site-b"));

  const std::string etag = job.etag();
  request.mutable_update_mask()->clear_paths();
  request.mutable_update_mask()->add_paths("display_name");
  request.mutable_job()->set_etag(etag);
  ASSERT_TRUE(Update(request, &job).ok());
  EXPECT_EQ(job.display_name(), "after");
  EXPECT_NE(job.etag(), etag);
  ASSERT_TRUE(Update(request, &job).ok());  // once more: the answer may have been lost
  request.mutable_job()->set_display_name("other");
  EXPECT_REFUSED(Update(request, &job), ABORTED, "ETAG_MISMATCH", "job.etag");
  request.mutable_job()->clear_etag();
  request.mutable_job()->set_display_name("two\nlines");
  EXPECT_REFUSED(Update(request, &job), INVALID_ARGUMENT, "TEXT_INVALID", "job.display_name");
  request.mutable_job()->set_display_name(std::string(201, 'x'));
  EXPECT_REFUSED(Update(request, &job), INVALID_ARGUMENT, "DISPLAY_NAME_TOO_LONG",
                 "job.display_name");
  for (const char* path : {"labels", "policy.priority"}) {
    (*request.mutable_job()->mutable_labels())["a"] = "no value!";
    request.mutable_job()->mutable_policy()->set_priority(101);
    request.mutable_update_mask()->set_paths(0, path);
    EXPECT_EQ(DetailOf(Update(request, &job)).field,
              std::string(path) == "labels" ? "job.labels.a" : "job.policy.priority");
  }
}

TEST_F(ManageApi, CallsThatAreRepeatedChangeNothing) {
  const std::string job = NewJob();
  for (const char* name : {"a.png", "b.png", "c.png"}) {
    ASSERT_TRUE(client_.Upload(job, {{name, TestPng(64, 48, name[0])}}).ok());
  }
  v1::StartJobRequest start;
  start.set_name(job);
  start.set_request_id("s");
  v1::Job first, second;
  ASSERT_TRUE(Call(&v1::ReconstructionService::Stub::StartJob, start, &first).ok());
  ASSERT_TRUE(Call(&v1::ReconstructionService::Stub::StartJob, start, &second).ok());
  EXPECT_EQ(first.last_event(), second.last_event());
  start.set_request_id(std::string(65, 'x'));
  EXPECT_REFUSED(Call(&v1::ReconstructionService::Stub::StartJob, start, &first), INVALID_ARGUMENT,
                 "REQUEST_ID_INVALID", "request_id");
  ASSERT_TRUE(client_.Cancel(job).ok());
  v1::DeleteJobRequest remove;
  remove.set_name(job);
  google::protobuf::Empty empty;
  const auto erase = [&] {
    return Call(&v1::ReconstructionService::Stub::DeleteJob, remove, &empty);
  };
  ASSERT_TRUE(erase().ok());
  EXPECT_REFUSED(erase(), NOT_FOUND, "JOB_NOT_FOUND", "name");
  remove.set_allow_missing(true);
  EXPECT_TRUE(erase().ok());
}

TEST_F(ManageApi, SeveralJobsAreDeletedAndTheOthersNamed) {
  v1::BatchDeleteJobsRequest request;
  request.add_names(NewJob());
  request.add_names("jobs/0123456789abcdef");
  request.add_names(NewJob());
  request.add_names("nonsense");
  v1::BatchDeleteJobsResponse response;
  ASSERT_TRUE(Call(&v1::ReconstructionService::Stub::BatchDeleteJobs, request, &response).ok());
  ASSERT_EQ(response.failures_size(), 2);
  EXPECT_EQ(response.failures(0).name(), request.names(1));
  EXPECT_EQ(response.failures(0).error().detail().reason(), "JOB_NOT_FOUND");
  EXPECT_EQ(response.failures(1).error().detail().reason(), "JOB_NAME_INVALID");
  EXPECT_THAT(Listed({}), IsEmpty());
  for (int i = 0; i < 100; ++i) request.add_names("jobs/x");
  EXPECT_REFUSED(Call(&v1::ReconstructionService::Stub::BatchDeleteJobs, request, &response),
                 INVALID_ARGUMENT, "TOO_MANY_IN_CALL", "names");
}

// Its database cannot be reached.
class StoreThatIsAway : public ForwardingJobStore {
 public:
  explicit StoreThatIsAway(JobStore* store) : ForwardingJobStore(store) {}
  absl::StatusOr<JobRecord> Update(std::string_view, Change) override { return Away(); }
  static absl::Status Away() {
    return MakeError(absl::StatusCode::kUnavailable, "STORE_UNAVAILABLE", "",
                     "connection to server at \"10.0.0.5\", port 5432 failed");
  }
};

TEST_F(ManageApi, WhatAStoreThatIsAwaySaysIsNotForClients) {
  StoreThatIsAway away(store_.get());
  Jobs jobs(&away, blobs_.get(), data_);
  const auto server = *StartServer(Options(), &jobs, engine_.get());
  TestClient client(server->InProcessChannel());
  v1::BatchDeleteJobsRequest request;
  request.add_names(NewJob());
  v1::BatchDeleteJobsResponse response;
  grpc::ClientContext context;
  const grpc::Status status = client.jobs->BatchDeleteJobs(&context, request, &response);
  EXPECT_EQ(status.error_code(), grpc::UNAVAILABLE);
  EXPECT_EQ(DetailOf(status).reason, "STORE_UNAVAILABLE");
  for (const std::string& said : {status.error_message(), response.DebugString(),
                                  ErrorToProto(JobError::Of(StoreThatIsAway::Away())).message()}) {
    EXPECT_THAT(said, Not(HasSubstr("10.0.0.5")));
  }
}

TEST_F(ManageApi, QueuedJobsKnowTheirTurn) {
  const std::string first = client_.StartedJob({"a", "b", "c"});
  const std::string second = client_.StartedJob({"a", "b", "c"});
  v1::Job job;
  ASSERT_TRUE(client_.Get(second, &job).ok());
  EXPECT_EQ(job.queue_position(), 2);
  ASSERT_TRUE(client_.Cancel(first).ok());
  ASSERT_TRUE(client_.Get(second, &job).ok());
  EXPECT_EQ(job.queue_position(), 1);
  ASSERT_TRUE(client_.Get(first, &job).ok());
  EXPECT_EQ(job.queue_position(), 0);
}

TEST_F(ManageApi, AChangeThatWasMadeIsToldThoughTheStoreThenGoesAway) {
  class AwayAfterwards : public ForwardingJobStore {
   public:
    explicit AwayAfterwards(JobStore* store) : ForwardingJobStore(store) {}
    absl::StatusOr<JobQueue> Queue() override {  // read after the change
      return MakeError(absl::StatusCode::kUnavailable, "STORE_UNAVAILABLE", "", "away");
    }
  };
  const std::string job = NewJob();
  ASSERT_TRUE(client_
                  .Upload(job, {{"a.png", TestPng(64, 48, 1)},
                                {"b.png", TestPng(64, 48, 2)},
                                {"c.png", TestPng(64, 48, 3)}})
                  .ok());
  AwayAfterwards store(store_.get());
  Jobs jobs(&store, blobs_.get(), data_);
  server_ = *StartServer(Options(), &jobs, engine_.get());
  client_ = TestClient(server_->InProcessChannel());
  v1::Job started;
  const grpc::Status status = client_.Start(job, &started);
  EXPECT_TRUE(status.ok()) << status.error_message();
  EXPECT_EQ(started.state(), v1::JOB_STATE_QUEUED);
  EXPECT_EQ(started.queue_position(), 0);
  server_.reset();  // before its store
}

TEST_F(ManageApi, TheLogIsFollowedToTheEndAndReadAgain) {
  const std::string job = client_.StartedJob({"a", "b", "c"});
  StartWorker();
  v1::GetLogRequest request;
  request.set_name(job);
  request.set_follow(true);
  grpc::Status status;
  const std::vector<v1::LogEntry> followed = Log(request, &status);
  ASSERT_TRUE(status.ok()) << status.error_message();
  ASSERT_GE(followed.size(), 4u);
  for (size_t i = 0; i < followed.size(); ++i) {
    EXPECT_EQ(followed[i].number(), static_cast<int64_t>(i) + 1);
    EXPECT_GT(followed[i].time().seconds(), 0);
  }
  EXPECT_THAT(followed.back().text(), HasSubstr("SUCCEEDED"));
  std::set<std::string> texts;
  for (const v1::LogEntry& entry : followed) texts.insert(entry.text());
  EXPECT_TRUE(texts.contains("QUEUED: started"));
  EXPECT_TRUE(texts.contains("loading"));
  // What COLMAP would say, but for the server's paths.
  const bool hears_programs = std::any_of(texts.begin(), texts.end(), [](const std::string& text) {
    return text.starts_with("a program says: ") && text.find("/tmp") == std::string::npos;
  });
  EXPECT_TRUE(hears_programs);

  request.set_follow(false);
  request.set_after_entry(2);
  const std::vector<v1::LogEntry> again = Log(request, &status);
  ASSERT_TRUE(status.ok());
  ASSERT_EQ(again.size(), followed.size() - 2);
  EXPECT_EQ(again[0].SerializeAsString(), followed[2].SerializeAsString());
  request.set_after_entry(static_cast<int64_t>(followed.size()) + 1);
  Log(request, &status);
  EXPECT_REFUSED(status, OUT_OF_RANGE, "LOG_ENTRY_NOT_YET", "after_entry");
  request.set_after_entry(-1);
  Log(request, &status);
  EXPECT_REFUSED(status, INVALID_ARGUMENT, "LOG_ENTRY_INVALID", "after_entry");
}

TEST_F(ManageApi, AServerSaysWhatItAllows) {
  const std::string job = client_.StartedJob({"a", "b", "c"});
  v1::ServerInfo info;
  ASSERT_TRUE(
      Call(&v1::ReconstructionService::Stub::GetServerInfo, v1::GetServerInfoRequest(), &info)
          .ok());
  EXPECT_THAT(info.version(), ::testing::MatchesRegex("[0-9]+\\.[0-9]+\\.[0-9]+"));
  std::set<std::string> methods;
  for (const v1::MethodInfo& method : info.methods()) {
    methods.insert(method.name());
    EXPECT_EQ(method.defaults().method(), method.method());
    // In force as they are sent.
    v1::CreateJobRequest request;
    *request.mutable_options() = method.defaults();
    v1::Job made;
    EXPECT_TRUE(client_.Create(request, &made).ok());
    EXPECT_EQ(made.options().ShortDebugString(), method.defaults().ShortDebugString());
  }
  EXPECT_EQ(methods, (std::set<std::string>{"litags", "litags-paper", "3dgs"}));
  EXPECT_EQ(info.options_size(), v1::JobOptions::descriptor()->field_count());
  std::map<std::string, v1::OptionInfo> options;
  for (const v1::OptionInfo& option : info.options()) {
    EXPECT_NE(v1::JobOptions::descriptor()->FindFieldByName(option.name()), nullptr);
    EXPECT_NE(option.help(), "");
    options[option.name()] = option;
  }
  EXPECT_EQ(options["sh_degree"].maximum(), 3);
  EXPECT_FALSE(options["sh_degree"].maximum_excluded());
  EXPECT_EQ(options["min_registered"].minimum(), 0);
  EXPECT_TRUE(options["min_registered"].minimum_excluded());
  EXPECT_EQ(options["method"].choices_size(), 3);
  EXPECT_NE(options["threads"].zero_means(), "");
  EXPECT_EQ(info.job_limits().min_photos(), 3);
  EXPECT_EQ(info.job_limits().max_iterations(), 100'000);
  // An option's range is what a job may ask for, not what the engine could do.
  EXPECT_EQ(options["iterations"].maximum(), 100'000);
  EXPECT_EQ(options["max_gaussians"].maximum(), info.job_limits().max_gaussians());
  EXPECT_EQ(info.client().jobs(), 1);
  EXPECT_GT(info.client().bytes(), 0);
  EXPECT_EQ(info.client().max_jobs(), 1000);
}

}  // namespace
}  // namespace litags
