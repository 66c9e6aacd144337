// Browsers that ask for pictures through the page's gateway and do not read them.
#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <chrono>
#include <map>
#include <string>
#include <thread>

#include "absl/strings/str_cat.h"
#include "engine/core/unique_fd.h"
#include "server/auth/tokens.h"
#include "server/testing/api_fixture.h"
#include "server/testing/eventually.h"
#include "server/web/web_server.h"

namespace litags {
namespace {

// A connection to the page. Unread, the kernel takes in a part of a picture only.
class Browser {
 public:
  Browser(int port, const std::string& token, const std::string& path, const std::string& body)
      : socket_(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in address = {};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    address.sin_port = htons(static_cast<uint16_t>(port));
    EXPECT_EQ(connect(socket_.get(), reinterpret_cast<sockaddr*>(&address), sizeof(address)), 0);
    const std::string request = absl::StrCat(
        "POST /v1/", path, " HTTP/1.1\r\nHost: 127.0.0.1\r\nAuthorization: Bearer ", token,
        "\r\nConnection: close\r\nContent-Length: ", body.size(), "\r\n\r\n", body);
    EXPECT_EQ(write(socket_.get(), request.data(), request.size()),
              static_cast<ssize_t>(request.size()));
  }

  // What has come until the server ends the connection.
  std::string ReadAll() {
    std::string all, piece(1 << 20, '\0');
    while (true) {
      const ssize_t size = read(socket_.get(), piece.data(), piece.size());
      if (size <= 0) return all;
      all.append(piece.data(), static_cast<size_t>(size));
    }
  }

 private:
  UniqueFd socket_;
};

// Pictures of 12 MB, counted twice, and room for 40 MB, of which one client may have half.
class UnreadPages : public ApiTest {
 protected:
  void SetUp() override {
    StartWorker();
    job_ = client_.StartedJob({"a", "b", "c"}, 10);
    client_.WaitFor(job_, v1::JOB_STATE_SUCCEEDED);
    ServerOptions options = Options();
    options.answers.max_unread_bytes = 40'000'000;
    for (const auto& [name, token] : tokens_) {
      options.auth.token_entries.push_back(TokenEntry(name, token));
      options.auth.admins.push_back(name);  // who see the job
    }
    server_ = *StartServer(options, &jobs_, engine_.get());
    web::WebOptions page;
    page.listen = "127.0.0.1:0";
    web_ = *web::WebServer::Start(page, server_->InProcessChannel(), server_->unread());
  }

  Browser Open(const std::string& client, const std::string& verb, const std::string& what) {
    return Browser(web_->port(), tokens_.at(client), absl::StrCat(job_, ":", verb),
                   absl::StrCat("{", what,
                                R"(,"settings":{"width":1000,"height":1000,)"
                                R"("format":"PICTURE_FORMAT_RAW_FLOAT"}})"));
  }
  Browser OpenPath(const std::string& client) {
    return Open(client, "renderPath", R"("orbit":{"radiusScale":1},"frames":1)");
  }
  Browser OpenView(const std::string& client) {
    return Open(client, "renderView", R"("pose":{"camera":"b.png"})");
  }

  // Why the client gets no small picture; empty: it gets it.
  std::string Refusal(const std::string& client) {
    grpc::ClientContext call;
    call.AddMetadata("authorization", "Bearer " + tokens_.at(client));
    v1::RenderViewRequest request;
    request.set_name(job_);
    request.mutable_pose()->set_camera("b.png");
    v1::RenderedView view;
    const auto stub = v1::RenderService::NewStub(server_->InProcessChannel());
    const grpc::Status status = stub->RenderView(&call, request, &view);
    return status.ok() ? "" : DetailOf(status).reason;
  }

  bool BecomesRefused(const std::string& client, bool refused) {
    return Eventually([&] { return Refusal(client) == (refused ? "RENDER_QUEUE_FULL" : ""); });
  }

  // Not only while the answer is made. Between the call's end and the page's reading nobody holds
  // it.
  bool StaysRefused(const std::string& client) {
    return Eventually([&] {
      for (int i = 0; i < 20; ++i) {
        if (Refusal(client) != "RENDER_QUEUE_FULL") return false;
        std::this_thread::sleep_for(std::chrono::milliseconds(20));
      }
      return true;
    });
  }

  const std::map<std::string, std::string> tokens_ = {{"alice", MakeToken()}, {"bob", MakeToken()}};
  std::string job_;
  std::unique_ptr<web::WebServer> web_;
};

TEST_F(UnreadPages, AnEventTakesTheRoomOfItsClientUntilItIsRead) {
  {
    const Browser browser = OpenPath("alice");
    EXPECT_TRUE(BecomesRefused("alice", true));
    EXPECT_TRUE(BecomesRefused("bob", false));
    EXPECT_TRUE(StaysRefused("alice"));
  }
  EXPECT_TRUE(BecomesRefused("alice", false));
}

TEST_F(UnreadPages, APictureTakesTheRoomOfItsClientUntilItIsRead) {
  {
    const Browser browser = OpenView("alice");
    EXPECT_TRUE(BecomesRefused("alice", true));
    EXPECT_TRUE(BecomesRefused("bob", false));
    EXPECT_TRUE(StaysRefused("alice"));
  }
  EXPECT_TRUE(BecomesRefused("alice", false));
}

TEST_F(UnreadPages, WithoutRoomPathsWaitAndPicturesAreRefused) {
  Browser first = OpenPath("alice");
  ASSERT_TRUE(BecomesRefused("alice", true));
  Browser second = OpenPath("alice");
  EXPECT_NE(OpenView("alice").ReadAll().find("RENDER_QUEUE_FULL"), std::string::npos);
  EXPECT_TRUE(first.ReadAll().ends_with("event: end\ndata: {}\n\n\r\n0\r\n\r\n"));
  EXPECT_TRUE(second.ReadAll().ends_with("event: end\ndata: {}\n\n\r\n0\r\n\r\n"));
  EXPECT_TRUE(BecomesRefused("alice", false));
}

TEST_F(UnreadPages, APathThatIsReadEndsThoughAnotherAnswerTookTheRoom) {
  constexpr int64_t kPictureBytes = 24'000'000;
  grpc::ClientContext call;
  call.AddMetadata("authorization", "Bearer " + tokens_.at("alice"));
  v1::RenderPathRequest request;
  request.set_name(job_);
  request.set_frames(1);
  request.mutable_orbit()->set_radius_scale(1);
  request.mutable_settings()->set_width(1000);
  request.mutable_settings()->set_height(1000);
  request.mutable_settings()->set_format(v1::PICTURE_FORMAT_RAW_FLOAT);
  const auto stub = v1::RenderService::NewStub(server_->InProcessChannel());
  const auto path = stub->RenderPath(&call, request);
  ASSERT_TRUE(BecomesRefused("alice", true));
  server_->unread()->Add("alice", kPictureBytes);
  v1::RenderPathResponse frame;
  EXPECT_TRUE(path->Read(&frame));
  EXPECT_FALSE(path->Read(&frame));
  EXPECT_TRUE(path->Finish().ok());
  server_->unread()->Add("alice", -kPictureBytes);
}

}  // namespace
}  // namespace litags
