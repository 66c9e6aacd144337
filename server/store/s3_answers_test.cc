// Answers of S3 servers that Swift does not give: a server in this process gives them.
#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <functional>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "engine/core/error_test_util.h"
#include "server/store/blob_store.h"

namespace litags {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

struct Answer {
  int code = 200;  // 0: the connection ends without an answer
  std::string body;
  std::string header;  // "name: value\r\n"
};

// Answers each request, one a connection, as `answer` says by its first line ("PUT /bucket/key").
class S3Stub {
 public:
  explicit S3Stub(std::function<Answer(const std::string& line)> answer)
      : answer_(std::move(answer)) {
    listener_ = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof(address);
    auto* const generic = reinterpret_cast<sockaddr*>(&address);
    EXPECT_EQ(bind(listener_, generic, size), 0);
    EXPECT_EQ(listen(listener_, 64), 0);
    EXPECT_EQ(getsockname(listener_, generic, &size), 0);
    port_ = ntohs(address.sin_port);
    thread_ = std::thread([this] { Loop(); });
  }
  ~S3Stub() {
    ends_ = true;
    shutdown(listener_, SHUT_RDWR);
    thread_.join();
    close(listener_);
  }

  std::unique_ptr<BlobStore> Open() const {
    S3Options options;
    options.endpoint = absl::StrCat("http://127.0.0.1:", port_);
    options.bucket = options.access_key = options.secret_key = "x";
    options.part_bytes = 1000;
    options.patience_seconds = 5;
    return *OpenS3BlobStore(options);
  }
  std::vector<std::string> Lines() {
    std::lock_guard lock(mutex_);
    return lines_;
  }

 private:
  void Loop() {
    while (!ends_) {
      const int client = accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC);
      if (client < 0) continue;
      Serve(client);
      close(client);
    }
  }

  void Serve(int client) {
    std::string request(1 << 16, '\0'), all;
    size_t wanted = 0;
    while (wanted == 0 || all.size() < wanted) {
      const ssize_t n = recv(client, request.data(), request.size(), 0);
      if (n <= 0) return;
      all.append(request, 0, static_cast<size_t>(n));
      const size_t end = all.find("\r\n\r\n");
      if (wanted > 0 || end == std::string::npos) continue;
      const size_t at = all.find("Content-Length: ");
      wanted = end + 4 + (at < end ? std::strtoul(all.c_str() + at + 16, nullptr, 10) : 0);
    }
    const std::string line = all.substr(0, all.find(" HTTP"));
    {
      std::lock_guard lock(mutex_);
      lines_.push_back(line);
    }
    const Answer answer = answer_(line);
    if (answer.code == 0) return;
    std::string text =
        absl::StrCat("HTTP/1.1 ", answer.code, " X\r\nConnection: close\r\n", answer.header);
    if (!absl::StrContains(answer.header, "Content-Length")) {
      absl::StrAppend(&text, "Content-Length: ", answer.body.size(), "\r\n");
    }
    absl::StrAppend(&text, "\r\n", answer.body);
    EXPECT_EQ(send(client, text.data(), text.size(), MSG_NOSIGNAL), ssize_t(text.size()));
  }

  const std::function<Answer(const std::string&)> answer_;
  int listener_ = -1, port_ = 0;
  std::atomic<bool> ends_{false};
  std::mutex mutex_;
  std::vector<std::string> lines_;
  std::thread thread_;
};

Answer NoSuch(const std::string& code) {
  return {404, absl::StrCat("<Error><Code>", code, "</Code></Error>"), ""};
}

// Completes an upload, loses the answer, and has forgotten the upload when it is asked again.
std::function<Answer(const std::string&)> Forgetful(int64_t stored_bytes) {
  return [stored_bytes, completed = false](const std::string& line) mutable -> Answer {
    if (absl::StartsWith(line, "POST") && absl::StrContains(line, "uploads")) {
      return {200, "<UploadId>u1</UploadId>", ""};
    }
    if (absl::StartsWith(line, "POST")) {
      if (completed) return NoSuch("NoSuchUpload");
      completed = true;
      return {0, "", ""};
    }
    if (absl::StartsWith(line, "HEAD")) {
      return {200, "", absl::StrCat("Content-Length: ", stored_bytes, "\r\n")};
    }
    return {200, "", "ETag: e\r\n"};
  };
}

TEST(S3Answers, UploadWhoseCompletionWasForgottenIsStoredIfItsBytesAreThere) {
  S3Stub stored(Forgetful(2500)), half(Forgetful(1000));
  const absl::Status status = stored.Open()->Put("jobs/1/aa", std::string(2500, 'x'));
  EXPECT_TRUE(status.ok()) << status;
  EXPECT_THAT(stored.Lines(), Not(Contains(HasSubstr("DELETE"))));
  EXPECT_EQ(Reason(half.Open()->Put("jobs/1/aa", std::string(2500, 'x'))), "STORE_FAILED");
}

TEST(S3Answers, AbandonedUploadsOfOursAreAborted) {
  const auto upload = [](const char* key, const char* id, const char* begun) {
    return absl::StrCat("<Upload><Key>", key, "</Key><UploadId>", id, "</UploadId><Initiated>",
                        begun, "</Initiated></Upload>");
  };
  constexpr char kLongAgo[] = "2020-01-01T00:00:00.000Z", kLater[] = "2999-01-01T00:00:00.000Z";
  S3Stub stub([&](const std::string& line) -> Answer {
    if (!absl::StrContains(line, "uploads")) return {};
    if (!absl::StrContains(line, "key-marker")) {
      return {
          200,
          absl::StrCat("<IsTruncated>true</IsTruncated><NextKeyMarker>jobs/1/bb</NextKeyMarker>",
                       "<NextUploadIdMarker>new</NextUploadIdMarker>",
                       upload("jobs/1/aa", "old", kLongAgo), upload("jobs/1/bb", "new", kLater)),
          ""};
    }
    return {200,
            absl::StrCat("<IsTruncated>false</IsTruncated>", upload("jobs/2/cc", "last", kLongAgo)),
            ""};
  });
  stub.Open()->RemoveTemporary();
  std::vector<std::string> aborted;
  for (const std::string& line : stub.Lines()) {
    if (absl::StartsWith(line, "DELETE")) aborted.push_back(line);
  }
  EXPECT_THAT(aborted,
              ElementsAre("DELETE /x/jobs/1/aa?uploadId=old", "DELETE /x/jobs/2/cc?uploadId=last"));
  EXPECT_THAT(stub.Lines(), Contains(HasSubstr("prefix=jobs%2F")));
}

TEST(S3Answers, RefusalsWith400AreThoseOfTheKeyAndTimeoutsPass) {
  const auto reason_of = [](const char* code) {
    S3Stub stub([code](const std::string& line) -> Answer {
      if (absl::StartsWith(line, "GET")) return {};
      return {400, absl::StrCat("<Error><Code>", code, "</Code></Error>"), ""};
    });
    return Reason(stub.Open()->Put("jobs/1/aa", "x"));
  };
  EXPECT_EQ(reason_of("ExpiredToken"), "BLOBS_DENIED");
  EXPECT_EQ(reason_of("RequestTimeTooSkewed"), "BLOBS_DENIED");
  EXPECT_EQ(reason_of("RequestTimeout"), "BLOBS_UNAVAILABLE");
  EXPECT_EQ(reason_of("InvalidArgument"), "STORE_FAILED");
  S3Stub stub([](const std::string& line) -> Answer {
    return absl::StartsWith(line, "HEAD") ? Answer{400, "", ""} : Answer();
  });
  EXPECT_EQ(Reason(stub.Open()->Get("jobs/1/aa").status()), "BLOBS_DENIED");
}

TEST(S3Answers, NotFoundAfterAWriteIsAFailureOfTheStore) {
  S3Stub stub([](const std::string& line) {
    return absl::StartsWith(line, "PUT") ? NoSuch("NoSuchKey") : Answer();
  });
  EXPECT_EQ(Reason(stub.Open()->Put("jobs/1/aa", "x")), "STORE_FAILED");
}

}  // namespace
}  // namespace litags
