#ifndef LITAGS_SERVER_TESTING_SLOW_CLIENT_FIXTURE_H_
#define LITAGS_SERVER_TESTING_SLOW_CLIENT_FIXTURE_H_

#include <grpcpp/create_channel.h>

#include <chrono>
#include <memory>
#include <string>

#include "server/testing/api_fixture.h"

namespace litags {

// A server over a real socket, and a client of it that takes in little by itself.
class SlowClientTest : public ApiTest {
 protected:
  using PathReader = std::unique_ptr<grpc::ClientReader<v1::RenderPathResponse>>;

  // It renders what the store has.
  void Serve(ServerOptions options, Engine* engine) {
    options.listen = "127.0.0.1:0";
    server_ = *StartServer(options, &jobs_, engine);
    const std::string address = "127.0.0.1:" + std::to_string(server_->port());
    const auto credentials = grpc::InsecureChannelCredentials();
    client_ = TestClient(grpc::CreateChannel(address, credentials));
    grpc::ChannelArguments arguments;  // gRPC takes in some MB by itself, unless told not to
    arguments.SetInt(GRPC_ARG_HTTP2_BDP_PROBE, 0);
    arguments.SetInt(GRPC_ARG_HTTP2_STREAM_LOOKAHEAD_BYTES, 64 << 10);
    slow_channel_ = grpc::CreateCustomChannel(address, credentials, arguments);
    slow_client_ = TestClient(slow_channel_);
  }

  // So large that few pictures are on their way: 1.1 MB.
  static void SetLarge(v1::RenderSettings* settings) {
    settings->set_width(300);
    settings->set_height(300);
    settings->set_format(v1::PICTURE_FORMAT_RAW_FLOAT);
  }

  // Of the slow client, with large frames.
  PathReader OpenPath(grpc::ClientContext* call, const std::string& job, int frames) {
    call->set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(60));
    v1::RenderPathRequest path;
    path.set_name(job);
    path.mutable_orbit()->set_radius_scale(1);
    path.set_frames(frames);
    SetLarge(path.mutable_settings());
    return slow_client_.render->RenderPath(call, path);
  }

  std::shared_ptr<grpc::Channel> slow_channel_;
  TestClient slow_client_{server_->InProcessChannel()};
};

}  // namespace litags

#endif  // LITAGS_SERVER_TESTING_SLOW_CLIENT_FIXTURE_H_
