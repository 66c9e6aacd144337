// CloneJob, and options that are given as they were read.
#include <gtest/gtest.h>

#include <string>

#include "server/testing/api_fixture.h"

namespace litags {
namespace {

class CloneApi : public ApiTest {
 protected:
  grpc::Status Clone(const v1::CloneJobRequest& request, v1::Job* clone) {
    grpc::ClientContext context;
    return client_.jobs->CloneJob(&context, request, clone);
  }
};

TEST_F(CloneApi, ACloneNeedsNoPhotosAgain) {
  const std::string job = client_.StartedJob({"a", "b", "c"});
  v1::CloneJobRequest request;
  request.set_name(job);
  request.mutable_options()->set_iterations(50);
  request.set_request_id("once");
  v1::Job clone, again;
  const grpc::Status status = Clone(request, &clone);
  ASSERT_TRUE(status.ok()) << status.error_message();
  EXPECT_EQ(clone.photos(), 3);
  EXPECT_EQ(clone.options().iterations(), 50);
  ASSERT_TRUE(Clone(request, &again).ok());
  EXPECT_EQ(again.name(), clone.name());
  request.mutable_options()->set_iterations(51);
  EXPECT_REFUSED(Clone(request, &again), ALREADY_EXISTS, "REQUEST_ID_REUSED", "request_id");
  StartWorker();
  ASSERT_TRUE(client_.Start(clone.name()).ok());
  EXPECT_EQ(client_.WaitFor(clone.name(), v1::JOB_STATE_SUCCEEDED).state(),
            v1::JOB_STATE_SUCCEEDED);
}

TEST_F(CloneApi, ARepeatedCallKnowsItsCloneAlsoWhenTheSourceIsGone) {
  v1::CloneJobRequest request;
  request.set_name(NewJob());
  request.set_request_id("once");
  v1::Job clone, again;
  ASSERT_TRUE(Clone(request, &clone).ok());
  ASSERT_TRUE(client_.Delete(request.name()).ok());
  const grpc::Status status = Clone(request, &again);
  ASSERT_TRUE(status.ok()) << status.error_message();
  EXPECT_EQ(again.name(), clone.name());
  request.set_request_id("another");
  EXPECT_REFUSED(Clone(request, &again), NOT_FOUND, "JOB_NOT_FOUND", "name");
}

TEST_F(CloneApi, OptionsAsTheyWereReadAreWhatTheJobHas) {
  const auto clone = [&](const std::string& name, const v1::JobOptions& options) {
    v1::CloneJobRequest request;
    request.set_name(name);
    *request.mutable_options() = options;
    v1::Job job;
    const grpc::Status status = Clone(request, &job);
    EXPECT_TRUE(status.ok()) << status.error_message();
    return job;
  };
  v1::Job job;
  ASSERT_TRUE(client_.Get(NewJob(), &job).ok());
  EXPECT_EQ(job.options().tone(), v1::TONE_CAPTURE);
  v1::JobOptions plain = job.options();
  plain.set_method(v1::METHOD_3DGS);
  EXPECT_EQ(clone(job.name(), plain).options().tone(), v1::TONE_NONE);
  v1::JobOptions chosen;
  chosen.set_tone(v1::TONE_CAPTURE);
  const v1::Job bright = clone(job.name(), chosen);
  chosen.set_method(v1::METHOD_3DGS);
  EXPECT_EQ(clone(job.name(), chosen).options().tone(), v1::TONE_CAPTURE);
  EXPECT_EQ(clone(bright.name(), plain).options().tone(), v1::TONE_CAPTURE);
  plain.set_tone(v1::TONE_UNSPECIFIED);  // the method's again
  EXPECT_EQ(clone(bright.name(), plain).options().tone(), v1::TONE_NONE);
  chosen.set_depth_source(v1::DEPTH_SOURCE_NONE);
  chosen.set_white_balance(v1::WHITE_BALANCE_CAMERA);
  const v1::Job other = clone(job.name(), chosen);
  v1::JobOptions unspecified;  // the defaults again
  unspecified.set_method(v1::METHOD_UNSPECIFIED);
  unspecified.set_depth_source(v1::DEPTH_SOURCE_UNSPECIFIED);
  unspecified.set_white_balance(v1::WHITE_BALANCE_UNSPECIFIED);
  const v1::JobOptions reset = clone(other.name(), unspecified).options();
  EXPECT_EQ(reset.method(), job.options().method());
  EXPECT_EQ(reset.depth_source(), job.options().depth_source());
  EXPECT_EQ(reset.white_balance(), job.options().white_balance());

  StartWorker();
  v1::ResumeJobRequest more;
  more.set_name(client_.StartedJob({"a", "b", "c"}, 10));
  *more.mutable_options() = client_.WaitFor(more.name(), v1::JOB_STATE_SUCCEEDED).options();
  more.mutable_options()->set_iterations(20);
  grpc::ClientContext context;
  const grpc::Status resumed = client_.jobs->ResumeJob(&context, more, &job);
  EXPECT_TRUE(resumed.ok()) << resumed.error_message();
  plain = job.options();
  plain.set_method(v1::METHOD_3DGS);
  EXPECT_EQ(clone(job.name(), plain).options().tone(), v1::TONE_NONE);
}

TEST_F(CloneApi, ACloneKeepsAScheduleOfItsOwn) {
  v1::CreateJobRequest request;
  request.mutable_options()->set_iterations(100);
  request.mutable_options()->set_schedule_iterations(300);
  v1::Job job, clone;
  ASSERT_TRUE(client_.Create(request, &job).ok());
  v1::CloneJobRequest again;
  again.set_name(job.name());
  ASSERT_TRUE(Clone(again, &clone).ok());
  EXPECT_EQ(clone.options().schedule_iterations(), 300);
  request.mutable_options()->set_schedule_iterations(50);
  ASSERT_TRUE(client_.Create(request, &job).ok());
  again.set_name(job.name());
  ASSERT_TRUE(Clone(again, &clone).ok());
  EXPECT_EQ(clone.options().schedule_iterations(), 50);
}

}  // namespace
}  // namespace litags
