// Clients that ask for much and do not read it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <thread>

#include "server/testing/eventually.h"
#include "server/testing/slow_client_fixture.h"

namespace litags {
namespace {

using ::testing::HasSubstr;

// Pictures of 1.1 MB, twice in the server, and room for 4 MB, of which one client may have half.
class UnreadAnswers : public SlowClientTest {
 protected:
  void SetUp() override {
    job_ = FinishedJob();
    SetLarge(view_.mutable_settings());
    view_.set_name(job_);
    view_.mutable_pose()->set_camera("b.png");
  }

  void Serve(double max_unread_seconds) {
    ServerOptions options = Options();
    options.answers.max_unread_seconds = max_unread_seconds;
    options.answers.max_unread_bytes = 4'000'000;
    SlowClientTest::Serve(options, engine_.get());
  }

  std::string ViewRefusal() {
    v1::RenderedView view;
    return DetailOf(client_.Render(view_, &view)).reason;
  }

  // Until pictures are refused, or are not any more.
  bool BecomesRefused(bool refused) {
    return Eventually([&] { return (ViewRefusal() == "RENDER_QUEUE_FULL") == refused; });
  }

  std::string job_;
  v1::RenderViewRequest view_;
};

template <typename Message>
int ReadAll(grpc::ClientReader<Message>& reader) {
  int messages = 0;
  for (Message message; reader.Read(&message);) ++messages;
  return messages;
}

TEST_F(UnreadAnswers, PathIsCutOffAndItsMemoryFreed) {
  Serve(/*max_unread_seconds=*/3);
  grpc::ClientContext call;
  const PathReader reader = OpenPath(&call, job_, 50);
  EXPECT_TRUE(BecomesRefused(true));  // the first frame fills the client's half
  EXPECT_TRUE(BecomesRefused(false));
  EXPECT_LT(ReadAll(*reader), 50);
  const grpc::Status status = reader->Finish();
  EXPECT_EQ(status.error_code(), grpc::UNAVAILABLE) << status.error_message();
  EXPECT_THAT(status.error_message(), HasSubstr("not read in time"));
}

// A unary answer, held back as only a client can that is written for it.
TEST_F(UnreadAnswers, PictureIsCutOffAndItsMemoryFreed) {
  Serve(/*max_unread_seconds=*/3);
  grpc::ClientContext call;
  const grpc::internal::RpcMethod method("/litags.v1.RenderService/RenderView",
                                         grpc::internal::RpcMethod::SERVER_STREAMING);
  const std::unique_ptr<grpc::ClientReader<v1::RenderedView>> reader(
      grpc::internal::ClientReaderFactory<v1::RenderedView>::Create(slow_channel_.get(), method,
                                                                    &call, view_));
  reader->WaitForInitialMetadata();  // or a picture that asks for the room is there first
  EXPECT_TRUE(BecomesRefused(true));
  EXPECT_TRUE(BecomesRefused(false));
  EXPECT_EQ(ReadAll(*reader), 0);
  EXPECT_EQ(reader->Finish().error_code(), grpc::UNAVAILABLE);
}

TEST_F(UnreadAnswers, PathsWaitForRoomAndThenGoOn) {
  Serve(/*max_unread_seconds=*/30);
  grpc::ClientContext first_call, second_call;
  const PathReader first = OpenPath(&first_call, job_, 5);
  ASSERT_TRUE(BecomesRefused(true));
  const PathReader second = OpenPath(&second_call, job_, 5);
  std::thread first_reader([&] { EXPECT_EQ(ReadAll(*first), 5); });
  EXPECT_EQ(ReadAll(*second), 5);
  first_reader.join();
  EXPECT_TRUE(first->Finish().ok());
  EXPECT_TRUE(second->Finish().ok());
  EXPECT_TRUE(BecomesRefused(false));
}

}  // namespace
}  // namespace litags
