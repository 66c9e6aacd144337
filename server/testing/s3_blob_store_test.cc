// What is S3's own: failures of the network and of the server. Linked with the conformance cases.
#include <gtest/gtest.h>
#include <openssl/hmac.h>

#include <algorithm>
#include <map>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "engine/core/error.h"
#include "server/store/digest.h"
#include "server/testing/cutting_proxy.h"
#include "server/testing/s3_server.h"

namespace litags {
namespace {

std::string Reason(const absl::Status& status) {
  const auto detail = GetErrorDetail(status);
  return detail ? detail->reason : "";
}

class S3BlobStoreTest : public ::testing::Test {
 protected:
  void SetUp() override {
    server_ = SharedS3();
    if (!server_) GTEST_SKIP() << "s3rver is not installed here";
    options_ = server_->Options();
  }

  S3Server* server_ = nullptr;
  S3Options options_;
};

// The signature that AWS's documentation, "Create a signed AWS API request", asks for.
std::string Hmac(const std::string& key, const std::string& text) {
  unsigned char digest[EVP_MAX_MD_SIZE];
  unsigned int size = 0;
  HMAC(EVP_sha256(), key.data(), static_cast<int>(key.size()),
       reinterpret_cast<const unsigned char*>(text.data()), text.size(), digest, &size);
  return std::string(reinterpret_cast<char*>(digest), size);
}

struct SignedRequest {
  std::string method, path, query, scope, signed_headers, signature;
  std::map<std::string, std::string> headers;

  static SignedRequest Parse(const std::string& text) {
    SignedRequest request;
    std::istringstream lines(text);
    std::string line, target;
    std::getline(lines, line);
    std::istringstream(line) >> request.method >> target;
    request.path = target.substr(0, target.find('?'));
    if (target.size() > request.path.size()) request.query = target.substr(request.path.size() + 1);
    while (std::getline(lines, line) && line != "\r") {
      const size_t colon = line.find(':');
      request.headers[absl::AsciiStrToLower(line.substr(0, colon))] =
          std::string(absl::StripAsciiWhitespace(line.substr(colon + 1)));
    }
    // AWS4-HMAC-SHA256 Credential=KEY/SCOPE, SignedHeaders=LIST, Signature=HEX
    const std::string& all = request.headers["authorization"];
    const auto after = [&all](const std::string& name) {
      const size_t at = all.find(name) + name.size();
      return all.substr(at, all.find_first_of(", ", at) - at);
    };
    const std::string credential = after("Credential=");
    request.scope = credential.substr(credential.find('/') + 1);
    request.signed_headers = after("SignedHeaders=");
    request.signature = after("Signature=");
    return request;
  }

  std::string RightSignature(const std::string& secret) {
    std::vector<std::string> parameters = absl::StrSplit(query, '&');
    std::sort(parameters.begin(), parameters.end());
    std::string canonical = absl::StrCat(method, "\n", path, "\n", absl::StrJoin(parameters, "&"));
    for (const auto name : absl::StrSplit(signed_headers, ';')) {
      absl::StrAppend(&canonical, "\n", name, ":", headers[std::string(name)]);
    }
    absl::StrAppend(&canonical, "\n\n", signed_headers, "\n", headers["x-amz-content-sha256"]);
    const std::vector<std::string> parts = absl::StrSplit(scope, '/');
    std::string key = "AWS4" + secret;
    for (const std::string& part : parts) key = Hmac(key, part);
    return ToHex(Hmac(key, absl::StrCat("AWS4-HMAC-SHA256\n", headers["x-amz-date"], "\n", scope,
                                        "\n", Sha256::Hex(canonical))));
  }
};

TEST_F(S3BlobStoreTest, EveryKindOfRequestIsSignedAsTheProtocolAsks) {
  CuttingProxy proxy(server_->port());
  options_.endpoint = "http://127.0.0.1:" + std::to_string(proxy.port());
  auto blobs = *OpenS3BlobStore(options_);
  ASSERT_TRUE(blobs->Put("jobs/1/aa", std::string(6'000'000, 'x')).ok());
  ASSERT_TRUE(blobs->Link("jobs/1/aa", "jobs/1/bb").ok());
  ASSERT_TRUE(blobs->Put("jobs/1/cc", "small").ok());
  ASSERT_TRUE(blobs->Get("jobs/1/aa").ok());
  ASSERT_TRUE(blobs->List("jobs").ok());
  ASSERT_TRUE(blobs->RemoveFolder("jobs/1").ok());
  std::set<std::string> kinds;
  for (const std::string& text : proxy.Requests()) {
    if (text.find("\r\nAuthorization: AWS4-HMAC-SHA256") == std::string::npos) continue;
    SignedRequest request = SignedRequest::Parse(text);
    EXPECT_EQ(request.signature, request.RightSignature(options_.secret_key))
        << text.substr(0, text.find("\r\n\r\n"));
    EXPECT_NE(request.signed_headers.find("x-amz-content-sha256"), std::string::npos);
    kinds.insert(request.method);
  }
  EXPECT_EQ(kinds, (std::set<std::string>{"DELETE", "GET", "HEAD", "POST", "PUT"}));
}

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

TEST_F(S3BlobStoreTest, WrongKeyAndWrongBucketAreClearErrors) {
  S3Options wrong = options_;
  wrong.access_key = "guess";
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

TEST_F(S3BlobStoreTest, PrefixesKeepInstallationsApart) {
  auto one = *OpenS3BlobStore(options_);
  auto two = *OpenS3BlobStore(server_->Options());
  ASSERT_TRUE(one->Put("jobs/1/aa", "x").ok());
  EXPECT_TRUE(two->List("jobs")->empty());
  EXPECT_EQ(Reason(two->Get("jobs/1/aa").status()), "BLOB_NOT_FOUND");
}

}  // namespace
}  // namespace litags
