#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

#include "server/api/convert.h"
#include "server/testing/api_fixture.h"
#include "server/testing/photos.h"

namespace litags {
namespace {

using ::testing::HasSubstr;

#define EXPECT_REFUSED(call, code, why, where)                              \
  do {                                                                      \
    const grpc::Status refused = (call);                                    \
    EXPECT_EQ(refused.error_code(), grpc::code) << refused.error_message(); \
    EXPECT_EQ(DetailOf(refused).reason, why) << refused.error_message();    \
    EXPECT_EQ(DetailOf(refused).field, where) << refused.error_message();   \
    EXPECT_FALSE(refused.error_message().empty());                          \
  } while (false)

class JobsApi : public ApiTest {
 protected:
  std::string NewJob() {
    v1::Job job;
    EXPECT_TRUE(client_.Create({}, &job).ok());
    return job.name();
  }

  // What the service answers to the upload of one file into a new job.
  grpc::Status UploadOne(const TestFile& file) { return client_.Upload(NewJob(), {file}); }
};

TEST_F(JobsApi, DefaultsOfProtoAndEngineAreTheSame) {
  v1::Job job;
  ASSERT_TRUE(client_.Create({}, &job).ok());
  EXPECT_EQ(job.state(), v1::JOB_STATE_UPLOADING);
  const v1::JobOptions expected = OptionsToProto(ReconstructOptions());
  EXPECT_EQ(job.options().SerializeAsString(), expected.SerializeAsString());
  // Every field of the message is set, so each one has a counterpart in the engine.
  std::vector<const google::protobuf::FieldDescriptor*> set;
  expected.GetReflection()->ListFields(expected, &set);
  EXPECT_EQ(static_cast<int>(set.size()), v1::JobOptions::descriptor()->field_count());
}

TEST_F(JobsApi, EveryOptionReachesTheEngineAndComesBack) {
  v1::CreateJobRequest request;
  v1::JobOptions* o = request.mutable_options();
  o->set_method(v1::METHOD_3DGS);
  o->set_tone(v1::TONE_PAPER);
  o->set_theta(0.4);
  o->set_iterations(123);
  o->set_seed(~uint64_t{0});
  o->set_threads(3);
  o->set_max_gaussians(5000);
  o->set_sh_degree(1);
  o->set_use_pdm(false);
  o->set_use_prior(false);
  o->set_use_depth(false);
  o->set_max_image_side(640);
  o->set_holdout_every(5);
  o->set_min_registered(0.75);
  o->set_checkpoint_every(11);
  o->set_preview_every(12);
  o->set_exposure_ssim(0.25);
  o->set_pdm_hidden(4);
  o->set_pdm_every(3);
  o->set_coarse_levels(1);
  o->set_coarse_until(0.75);
  o->set_depth_source(v1::DEPTH_SOURCE_STEREO);
  o->set_depth_weight(0.5);
  o->set_depth_geometry(false);
  o->set_contrast(0.5);
  v1::Job job;
  const grpc::Status status = client_.Create(request, &job);
  ASSERT_TRUE(status.ok()) << status.error_message();
  EXPECT_EQ(job.options().ShortDebugString(), o->ShortDebugString());
}

TEST_F(JobsApi, OptionOutOfRangeNamesTheField) {
  v1::CreateJobRequest request;
  request.mutable_options()->set_theta(1.5);
  v1::Job job;
  grpc::Status status = client_.Create(request, &job);
  EXPECT_EQ(status.error_code(), grpc::INVALID_ARGUMENT);
  EXPECT_EQ(DetailOf(status).field, "options.theta");
  request.mutable_options()->set_theta(0.5);
  request.mutable_options()->set_method(static_cast<v1::Method>(77));
  EXPECT_REFUSED(client_.Create(request, &job), INVALID_ARGUMENT, "OPTION_OUT_OF_RANGE",
                 "options.method");
  request.mutable_options()->clear_method();
  request.mutable_options()->set_depth_source(static_cast<v1::DepthSource>(6));
  EXPECT_REFUSED(client_.Create(request, &job), INVALID_ARGUMENT, "OPTION_OUT_OF_RANGE",
                 "options.depth_source");
}

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
        client_.Upload(unknown, {}), client_.Render(render, &view)}) {
    EXPECT_REFUSED(status, NOT_FOUND, "JOB_NOT_FOUND", "name");
    EXPECT_THAT(status.error_message(), HasSubstr(unknown));
  }
  for (const std::string name : {"", "0123456789abcdef", "jobs/", "jobs/../../etc", "jobs/A"}) {
    EXPECT_REFUSED(client_.Get(name, &job), INVALID_ARGUMENT, "JOB_NAME_INVALID", "name");
  }
}

TEST_F(JobsApi, PhotosThatAreNoneAreRefusedByName) {
  const std::string jpeg = TestJpeg(200, 150);
  EXPECT_REFUSED(UploadOne({"a.jpg", "hello, this is text"}), INVALID_ARGUMENT,
                 "IMAGE_NOT_RECOGNIZED", "images[a.jpg]");
  EXPECT_REFUSED(UploadOne({"b.jpg", ""}), INVALID_ARGUMENT, "FILE_EMPTY", "images[b.jpg]");
  EXPECT_REFUSED(UploadOne({"c.jpg", jpeg.substr(0, jpeg.size() / 2)}), INVALID_ARGUMENT,
                 "IMAGE_TRUNCATED", "images[c.jpg]");
  const grpc::Status cameras = UploadOne({"d.json", "{", v1::FILE_ROLE_CAMERAS});
  EXPECT_EQ(cameras.error_code(), grpc::INVALID_ARGUMENT);
  EXPECT_THAT(DetailOf(cameras).field, HasSubstr("cameras[d.json]"));
  EXPECT_EQ(UploadOne({"e.npy", "junk", v1::FILE_ROLE_DEPTH}).error_code(), grpc::INVALID_ARGUMENT);
}

TEST_F(JobsApi, NamesThatAreNotPlainFileNamesAreRefused) {
  for (const std::string name : {"../a.jpg", "a/b.jpg", "/etc/a.jpg", "..", "", ".hidden.jpg",
                                 "a\\b.jpg", "a\nb.jpg", "a.txt", "noextension"}) {
    EXPECT_REFUSED(UploadOne({name, TestJpeg()}), INVALID_ARGUMENT, "BAD_FILE_NAME",
                   "images[" + name + "]");
  }
  const std::string longest(256, 'x');
  EXPECT_REFUSED(UploadOne({longest + ".jpg", TestJpeg()}), INVALID_ARGUMENT, "BAD_FILE_NAME",
                 "images[" + longest + ".jpg]");
}

TEST_F(JobsApi, DamagedAndDisorderlyUploadsAreRefused) {
  const std::string name = NewJob();
  const auto with_name = [&](std::vector<v1::UploadImagesRequest> messages) {
    messages.insert(messages.begin(), NameMessage(name));
    return messages;
  };
  const TestFile file{"a.png", TestPng()};
  EXPECT_REFUSED(client_.UploadRaw(with_name(FileMessages(file, std::string(32, 'x')))),
                 INVALID_ARGUMENT, "FILE_DIGEST_MISMATCH", "images[a.png]");
  EXPECT_REFUSED(client_.UploadRaw(with_name(FileMessages(file, "short"))), INVALID_ARGUMENT,
                 "FILE_DIGEST_MISSING", "images[a.png]");
  EXPECT_REFUSED(client_.UploadRaw(with_name(FileMessages(file, "", 1'000'000))), INVALID_ARGUMENT,
                 "FILE_TRUNCATED", "images[a.png]");
  EXPECT_REFUSED(client_.UploadRaw(with_name(FileMessages(file, "", 10))), INVALID_ARGUMENT,
                 "FILE_SIZE_MISMATCH", "images[a.png]");
  EXPECT_REFUSED(client_.UploadRaw(with_name(FileMessages(file, "", int64_t{1} << 40))),
                 RESOURCE_EXHAUSTED, "FILE_TOO_LARGE", "images[a.png]");
  EXPECT_REFUSED(client_.UploadRaw(FileMessages(file)), INVALID_ARGUMENT, "UPLOAD_ORDER", "part");
  EXPECT_REFUSED(client_.UploadRaw({}), INVALID_ARGUMENT, "UPLOAD_ORDER", "part");
  EXPECT_REFUSED(client_.UploadRaw({NameMessage(name), NameMessage(name)}), INVALID_ARGUMENT,
                 "UPLOAD_ORDER", "part");
  v1::Job job;
  ASSERT_TRUE(client_.Get(name, &job).ok());
  EXPECT_EQ(job.photos(), 0);
  EXPECT_TRUE(std::filesystem::is_empty(data_.tmp()));  // nothing is left of them
}

TEST_F(JobsApi, FilesBeforeTheBadOneStayAndUnchangedFilesCostNothing) {
  const std::string name = NewJob();
  EXPECT_EQ(client_.Upload(name, {{"a.png", TestPng(64, 48, 1)}, {"b.png", "bad"}}).error_code(),
            grpc::INVALID_ARGUMENT);
  v1::UploadImagesResponse response;
  const grpc::Status again = client_.Upload(
      name, {{"a.png", TestPng(64, 48, 1)}, {"b.png", TestPng(64, 48, 2)}}, &response);
  ASSERT_TRUE(again.ok()) << again.error_message();
  EXPECT_EQ(response.files_unchanged(), 1);
  EXPECT_EQ(response.files_stored(), 1);
  EXPECT_EQ(response.job().photos(), 2);
}

TEST_F(JobsApi, OnePhotoAndTwoSizesAreRefusedAtTheStart) {
  const std::string one = NewJob();
  ASSERT_TRUE(client_.Upload(one, {{"a.png", TestPng()}}).ok());
  EXPECT_REFUSED(client_.Start(one), FAILED_PRECONDITION, "TOO_FEW_PHOTOS", "images");
  const std::string two = NewJob();
  ASSERT_TRUE(client_.Upload(two, {{"a.png", TestPng(64, 48)}, {"b.png", TestPng(48, 64)}}).ok());
  EXPECT_REFUSED(client_.Start(two), FAILED_PRECONDITION, "PHOTO_SIZES_DIFFER", "images[b.png]");
}

TEST_F(JobsApi, ListPagesThroughAllJobsNewestFirst) {
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
  EXPECT_EQ(job.snapshot_iteration(), 40);
}

TEST_F(JobsApi, WatchResumedAfterEachEventHasNoGapAndNoDouble) {
  StartWorker();
  const std::string name = client_.StartedJob({"a", "b"});
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
  EXPECT_TRUE(none.empty());
}

TEST_F(JobsApi, WatchEndsWhenTheJobIsDeletedAndWhenTheServerStops) {
  const std::string deleted = NewJob(), kept = NewJob();
  std::vector<v1::JobEvent> a, b;
  grpc::Status status_a, status_b;
  std::thread watch_a([&] { status_a = client_.Watch(deleted, 0, &a); });
  std::thread watch_b([&] { status_b = client_.Watch(kept, 0, &b); });
  std::this_thread::sleep_for(std::chrono::milliseconds(200));
  EXPECT_TRUE(client_.Delete(deleted).ok());
  watch_a.join();
  EXPECT_REFUSED(status_a, NOT_FOUND, "JOB_NOT_FOUND", "name");
  server_->Shutdown();
  watch_b.join();
  EXPECT_REFUSED(status_b, UNAVAILABLE, "SHUTTING_DOWN", "");
  EXPECT_EQ(b.size(), 1u);
}

TEST_F(JobsApi, FailureOfTheEngineArrivesWithCodeReasonAndField) {
  StartWorker();
  const std::string name = client_.StartedJob({"fail", "b"});
  const v1::Job job = client_.WaitFor(name, v1::JOB_STATE_FAILED);
  EXPECT_EQ(job.error().code(), grpc::FAILED_PRECONDITION);
  EXPECT_EQ(job.error().detail().reason(), "SFM_TOO_FEW_VIEWS");
  EXPECT_THAT(job.error().message(), HasSubstr("take photos that overlap more"));
}

TEST_F(JobsApi, RunningJobIsCancelledWithinTwoSecondsAndResumesFromItsCheckpoint) {
  StartWorker();
  const std::string name = client_.StartedJob({"slow", "b"}, 100);
  std::vector<v1::JobEvent> events;
  do {  // until a snapshot says that a checkpoint is there too
    const size_t before = events.size();
    client_.Watch(name, static_cast<int64_t>(before), &events, before + 1);
  } while (!events.back().has_snapshot());
  const auto start = std::chrono::steady_clock::now();
  ASSERT_TRUE(client_.Cancel(name).ok());
  EXPECT_REFUSED(client_.Delete(name), FAILED_PRECONDITION, "JOB_RUNNING", "name");
  client_.WaitFor(name, v1::JOB_STATE_CANCELLED);
  // The promise to users, far above what it takes.
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(2));
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

}  // namespace
}  // namespace litags
