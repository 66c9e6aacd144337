// What is S3's own: failures of the network and of the server. Linked with the conformance cases.
#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <chrono>
#include <string>

#include "engine/core/error_test_util.h"
#include "server/store/digest.h"
#include "server/store/s3_client.h"
#include "server/testing/cutting_proxy.h"
#include "server/testing/s3_server.h"

namespace litags {
namespace {

class S3BlobStoreTest : public ::testing::Test {
 protected:
  void SetUp() override {
    server_ = SharedS3();
    if (!server_) GTEST_SKIP() << "OpenStack Swift (python3-swift) is not installed here";
    options_ = server_->Options();
  }

  S3Server* server_ = nullptr;
  S3Options options_;
};

TEST_F(S3BlobStoreTest, BrokenConnectionsCostAnotherTry) {
  CuttingProxy proxy(server_->port());
  options_.endpoint = "http://127.0.0.1:" + std::to_string(proxy.port());
  auto blobs = *OpenS3BlobStore(options_);
  const std::string large(12'000'000, 'x');
  for (const auto cut : {CuttingProxy::kBeforeRequest, CuttingProxy::kAfterRequest}) {
    for (const char* where : {"PUT /", "partNumber=2", "POST /"}) {
      proxy.CutAt(where, cut);
      const absl::Status status = blobs->Put("jobs/1/aa", large);
      EXPECT_TRUE(status.ok()) << where << " " << status;
      EXPECT_TRUE(proxy.has_cut()) << where;
    }
    proxy.CutAt("bytes=5242880-", cut);  // the second range
    const auto read = blobs->Get("jobs/1/aa");
    EXPECT_TRUE(read.ok() && *read == large) << read.status();
    EXPECT_TRUE(proxy.has_cut());
  }
}

TEST_F(S3BlobStoreTest, ServerThatIsRestartedIsWaitedForAndOneThatStaysAwayIsAnError) {
  auto blobs = *OpenS3BlobStore(options_);
  ASSERT_TRUE(blobs->Put("jobs/1/aa", "bytes").ok());
  server_->Kill();
  EXPECT_EQ(Reason(blobs->Get("jobs/1/aa").status()), "BLOBS_UNAVAILABLE");
  EXPECT_EQ(Reason(OpenS3BlobStore(options_).status()), "BLOBS_UNAVAILABLE");
  server_->Run();
  EXPECT_EQ(*blobs->Get("jobs/1/aa"), "bytes");
}

// Takes connections, as its kernel does while the program stands still, and says nothing.
TEST(SilentS3Test, ServerThatSaysNothingIsGivenUpInTime) {
  const int listener = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof(address);
  auto* const generic = reinterpret_cast<sockaddr*>(&address);
  ASSERT_EQ(bind(listener, generic, size), 0);
  ASSERT_EQ(listen(listener, 64), 0);
  ASSERT_EQ(getsockname(listener, generic, &size), 0);
  S3Options options;
  options.endpoint = "http://127.0.0.1:" + std::to_string(ntohs(address.sin_port));
  options.bucket = options.access_key = options.secret_key = "x";
  options.patience_seconds = 3;
  const auto start = std::chrono::steady_clock::now();
  EXPECT_EQ(Reason(OpenS3BlobStore(options).status()), "BLOBS_UNAVAILABLE");
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(30));
  close(listener);
}

TEST_F(S3BlobStoreTest, WrongKeyAndWrongBucketAreClearErrors) {
  S3Options wrong = options_;
  wrong.access_key = "guess";
  EXPECT_EQ(Reason(OpenS3BlobStore(wrong).status()), "BLOBS_DENIED");
  wrong = options_;
  wrong.secret_key = "guess";  // the server checks signatures
  EXPECT_EQ(Reason(OpenS3BlobStore(wrong).status()), "BLOBS_DENIED");
  wrong = options_;
  wrong.bucket = "none";
  EXPECT_EQ(Reason(OpenS3BlobStore(wrong).status()), "BLOBS_DENIED");
  wrong = options_;
  wrong.access_key = "";
  EXPECT_EQ(Reason(OpenS3BlobStore(wrong).status()), "BLOBS_DENIED");
}

TEST_F(S3BlobStoreTest, BytesThatWereChangedInTheStoreAreNotHandedOut) {
  auto blobs = *OpenS3BlobStore(options_);
  const std::string key = "jobs/1/" + Sha256::Hex("photo");
  ASSERT_TRUE(blobs->Put(key, "photo").ok());
  ASSERT_TRUE(blobs->Put(key, "phOto").ok());  // no check: the caller says what the bytes are
  EXPECT_EQ(Reason(blobs->Get(key).status()), "BLOB_DAMAGED");
}

TEST_F(S3BlobStoreTest, FoldersOfMoreThanOnePageAreListedAndRemoved) {
  options_.page_names = 3;
  auto blobs = *OpenS3BlobStore(options_);
  constexpr size_t kBlobs = 10;
  for (size_t i = 0; i < kBlobs; ++i) {
    ASSERT_TRUE(blobs->Put("jobs/1/" + std::to_string(i), "x").ok());
  }
  EXPECT_EQ(blobs->List("jobs/1")->size(), kBlobs);
  EXPECT_EQ(blobs->List("jobs")->size(), 1u);
  ASSERT_TRUE(blobs->RemoveFolder("jobs/1").ok());
  EXPECT_TRUE(blobs->List("jobs/1")->empty());
}

TEST_F(S3BlobStoreTest, UploadsThatNobodyCompletesAreAborted) {
  S3Client client(options_);
  const auto begin = [&](const std::string& key) {
    return client.Send(S3Request{"POST", key, {{"uploads", ""}}, {}, {}}).status();
  };
  const auto there = [&] {
    const auto page =
        client.Send(S3Request{"GET", "", {{"prefix", options_.prefix}, {"uploads", ""}}, {}, {}});
    return page.ok() ? XmlTexts(page->body, "UploadId").size() : 99;
  };
  ASSERT_TRUE(begin("jobs/1/aa").ok());
  ASSERT_TRUE(begin("others/1").ok());
  (*OpenS3BlobStore(options_))->RemoveTemporary();
  EXPECT_EQ(there(), 2u) << "somebody may be at it";
  options_.abandoned_seconds = -3600;
  (*OpenS3BlobStore(options_))->RemoveTemporary();
  EXPECT_EQ(there(), 1u);
}

TEST_F(S3BlobStoreTest, PrefixesKeepInstallationsApart) {
  auto one = *OpenS3BlobStore(options_);
  auto two = *OpenS3BlobStore(server_->Options());
  ASSERT_TRUE(one->Put("jobs/1/aa", "x").ok());
  EXPECT_TRUE(two->List("jobs")->empty());
  EXPECT_EQ(Reason(two->Get("jobs/1/aa").status()), "BLOB_NOT_FOUND");
}

}  // namespace
}  // namespace litags
