#include "server/webhooks/post.h"

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <string>
#include <thread>

#include "absl/strings/str_cat.h"
#include "engine/core/error_test_util.h"
#include "engine/core/unique_fd.h"

namespace litags {
namespace {

using ::testing::HasSubstr;

sockaddr_in6 Loopback6() {
  sockaddr_in6 address = {};
  address.sin6_family = AF_INET6;
  address.sin6_addr = in6addr_loopback;
  return address;
}

bool HasAddress6() {
  const UniqueFd fd(socket(AF_INET6, SOCK_STREAM, 0));
  const sockaddr_in6 address = Loopback6();
  return bind(fd.get(), reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0;
}

// Answers one connection with a text, and keeps what came.
class OneAnswer {
 public:
  // At 127.0.0.1, or at ::1.
  explicit OneAnswer(std::string answer, int family = AF_INET)
      : listener_(socket(family, SOCK_STREAM, 0)) {
    sockaddr_in6 six = Loopback6();
    sockaddr_in four = {};
    four.sin_family = AF_INET;
    four.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    auto* const address =
        family == AF_INET ? reinterpret_cast<sockaddr*>(&four) : reinterpret_cast<sockaddr*>(&six);
    socklen_t length = family == AF_INET ? sizeof(four) : sizeof(six);
    EXPECT_EQ(bind(listener_.get(), address, length), 0);
    EXPECT_EQ(listen(listener_.get(), 1), 0);
    getsockname(listener_.get(), address, &length);
    port_ = ntohs(family == AF_INET ? four.sin_port : six.sin6_port);
    thread_ = std::thread([this, answer = std::move(answer)] {
      const UniqueFd peer(accept(listener_.get(), nullptr, nullptr));
      char bytes[4096];
      while (request_.find("{end}") == std::string::npos) {
        const ssize_t size = read(peer.get(), bytes, sizeof(bytes));
        if (size <= 0) return;
        request_.append(bytes, static_cast<size_t>(size));
      }
      EXPECT_EQ(write(peer.get(), answer.data(), answer.size()),
                static_cast<ssize_t>(answer.size()));
    });
  }
  ~OneAnswer() { Request(); }

  std::string Url() const { return absl::StrCat("http://127.0.0.1:", port_, "/hook"); }
  int port() const { return port_; }
  const std::string& Request() {
    shutdown(listener_.get(), SHUT_RDWR);  // nobody came
    if (thread_.joinable()) thread_.join();
    return request_;
  }

 private:
  UniqueFd listener_;
  int port_ = 0;
  std::string request_;
  std::thread thread_;
};

PostOptions Internal() {
  PostOptions options;
  options.internal = true;
  options.timeout_seconds = 10;
  return options;
}

TEST(Post, SendsHeadersAndBody) {
  OneAnswer server("HTTP/1.1 204 No Content\r\n\r\n");
  const absl::Status status =
      Post(server.Url(), "{end}", {{"Litags-Event", "jobs/1/7"}}, Internal());
  EXPECT_TRUE(status.ok()) << status;
  EXPECT_THAT(server.Request(), HasSubstr("POST /hook HTTP/1.1\r\n"));
  EXPECT_THAT(server.Request(), HasSubstr("Litags-Event: jobs/1/7\r\n"));
  EXPECT_THAT(server.Request(), HasSubstr("\r\n\r\n{end}"));
}

TEST(Post, AnAnswerWithABodyIsAnAnswer) {
  OneAnswer server("HTTP/1.1 200 OK\r\nContent-Length: 5\r\n\r\nhello");
  EXPECT_TRUE(Post(server.Url(), "{end}", {}, Internal()).ok());
}

TEST(Post, OtherStatusesFail) {
  OneAnswer server("HTTP/1.1 503 Busy\r\nContent-Length: 0\r\n\r\n");
  const absl::Status status = Post(server.Url(), "{end}", {}, Internal());
  EXPECT_EQ(Reason(status), "WEBHOOK_FAILED");
  EXPECT_THAT(std::string(status.message()), HasSubstr("503"));
}

TEST(Post, RedirectsAreNotFollowed) {
  OneAnswer elsewhere("HTTP/1.1 200 OK\r\n\r\n");
  OneAnswer server(absl::StrCat("HTTP/1.1 307 Go\r\nLocation: ", elsewhere.Url(),
                                "\r\nContent-Length: 0\r\n\r\n"));
  EXPECT_THAT(std::string(Post(server.Url(), "{end}", {}, Internal()).message()), HasSubstr("307"));
  EXPECT_EQ(elsewhere.Request(), "");
}

TEST(Post, InternalAddressesAreNotReached) {
  OneAnswer server("HTTP/1.1 200 OK\r\n\r\n");
  // Without TLS nothing is sent at all; with it the socket is refused.
  EXPECT_EQ(Reason(Post(server.Url(), "{end}", {}, {})), "WEBHOOK_FAILED");
  for (const char* host : {"127.0.0.1", "localhost", "2130706433", "0x7f000001", "0"}) {
    const absl::Status status = Post(absl::StrCat("https://", host, "/"), "{end}", {}, {});
    EXPECT_THAT(std::string(status.message()), HasSubstr("no address of the internet")) << host;
  }
  EXPECT_EQ(server.Request(), "");
}

// libcurl tries "localhost" at 127.0.0.1, too.
TEST(Post, AnAnswerCountsWhereTheHostHasAnAddressBesideThatIsNotReached) {
  if (!HasAddress6()) GTEST_SKIP() << "there is no ::1 here";
  OneAnswer server("HTTP/1.1 204 No Content\r\n\r\n", AF_INET6);
  PostOptions options = Internal();
  options.may_reach = [](const sockaddr* address) { return address->sa_family == AF_INET6; };
  const std::string url = absl::StrCat("http://localhost:", server.port(), "/");
  const absl::Status status = Post(url, "{end}", {}, options);
  EXPECT_TRUE(status.ok()) << status;
}

}  // namespace
}  // namespace litags
