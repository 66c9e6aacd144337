// Streams of a client whose token is taken back while they are open.
#include <gtest/gtest.h>

#include <fstream>

#include "server/jobs/codec.h"
#include "server/store/digest.h"
#include "server/testing/access_fixture.h"
#include "server/testing/photos.h"

namespace litags {
namespace {

class RevokedTest : public AccessTest {
 protected:
  RevokedTest() {
    options_.auth.token_entries.clear();
    options_.auth.tokens_path = dir_.path() + "/tokens";
    Allow({"alice", "bob"});
    Start();
  }

  void Allow(const std::set<std::string>& names) {
    std::ofstream file(dir_.path() + "/tokens");
    for (const std::string& name : names) file << TokenEntry(name, tokens_.at(name)) << "\n";
  }

  // As the fake engine writes it.
  void StoreScene(const std::string& id) {
    const std::string scene = "1 5\na.png\nb.png\nc.png\n";
    const KeptFile file{LeaseBlob(1, Sha256::Hex(scene)), static_cast<int64_t>(scene.size())};
    ASSERT_TRUE(blobs_->Put(BlobKey(id, file.blob), scene).ok());
    const auto change = [&](JobTransaction& job) {
      job.job.kept = Encode(KeptFiles{{kSceneFile, file}});
      return absl::OkStatus();
    };
    ASSERT_TRUE(store_->Update(id, change).ok());
  }
};

#define EXPECT_TAKEN_BACK(call) \
  EXPECT_REFUSED(call, UNAUTHENTICATED, "TOKEN_INVALID", "authorization")

TEST_F(RevokedTest, OpenStreamsEndAndThoseOfOthersGoOn) {
  const std::string job = Created("alice"), other = Created("bob");
  // A watch and an upload that wait, one of them for its client.
  ClientCall watch_call(tokens_.at("alice")), upload_call(tokens_.at("alice"));
  ClientCall other_call(tokens_.at("bob"));
  const auto watch = stubs_->jobs->WatchJob(&watch_call, Named<v1::WatchJobRequest>(job));
  v1::JobEvent event;
  ASSERT_TRUE(watch->Read(&event));
  v1::UploadImagesResponse response, other_response;
  const auto upload = stubs_->jobs->UploadImages(&upload_call, &response);
  ASSERT_TRUE(upload->Write(NameMessage(job)));
  const auto other_upload = stubs_->jobs->UploadImages(&other_call, &other_response);
  ASSERT_TRUE(other_upload->Write(NameMessage(other)));

  Allow({"bob"});
  EXPECT_FALSE(watch->Read(&event));  // within the call's deadline
  EXPECT_TAKEN_BACK(watch->Finish());
  EXPECT_TAKEN_BACK(upload->Finish());

  for (const auto& message : FileMessages({"a.png", TestPng()})) {
    ASSERT_TRUE(other_upload->Write(message));
  }
  ASSERT_TRUE(other_upload->Write(EndMessage(1)));
  other_upload->WritesDone();
  const grpc::Status status = other_upload->Finish();
  EXPECT_TRUE(status.ok()) << status.error_message();
}

TEST_F(RevokedTest, AnUploadThatSendsOnEndsToo) {
  ClientCall call(tokens_.at("alice"));
  v1::UploadImagesResponse response;
  const auto upload = stubs_->jobs->UploadImages(&call, &response);
  ASSERT_TRUE(upload->Write(NameMessage(Created("alice"))));
  Allow({"bob"});
  bool open = true;
  for (int i = 0; open && i < 3000; ++i) {
    for (const auto& message : FileMessages({absl::StrCat(i, ".png"), TestPng(64, 48, i)})) {
      open = open && upload->Write(message);
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  EXPECT_TAKEN_BACK(upload->Finish());
}

TEST_F(RevokedTest, APathEndsBetweenTwoPictures) {
  const std::string job = Created("alice");
  StoreScene(job.substr(5));
  ClientCall call(tokens_.at("alice"));
  v1::RenderPathRequest request;
  request.set_name(job);
  request.mutable_orbit();
  request.set_frames(10'000);
  const auto path = stubs_->render->RenderPath(&call, request);
  v1::RenderPathResponse frame;
  ASSERT_TRUE(path->Read(&frame));
  Allow({"bob"});
  int frames = 1;
  while (path->Read(&frame)) {
    ++frames;
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  EXPECT_LT(frames, 10'000);
  EXPECT_TAKEN_BACK(path->Finish());
}

}  // namespace
}  // namespace litags
