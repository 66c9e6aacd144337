#include "server/api/server.h"

#include <grpcpp/ext/proto_server_reflection_plugin.h>
#include <grpcpp/grpcpp.h>
#include <grpcpp/health_check_service_interface.h>

#include <chrono>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "server/api/event_hub.h"
#include "server/api/model_service.h"
#include "server/api/reconstruction_service.h"
#include "server/api/scene_cache.h"
#include "server/api/status.h"
#include "server/api/thread_pool.h"

namespace litags {
namespace {

// Chunks have 1 MiB at most, and little else in their message.
constexpr int kMaxReceiveBytes = 2 << 20;
// A picture of 16 megapixels as three raw floats.
constexpr int kMaxSendBytes = 256 << 20;
constexpr int kKeepaliveMs = 30'000;
constexpr int kMinPingIntervalMs = 10'000;
constexpr std::chrono::seconds kShutdownGrace{1};

class GrpcServer : public Server {
 public:
  GrpcServer(const ServerOptions& options, Jobs* jobs, Engine* engine)
      : store_pool_(options.store_threads, options.max_waiting_calls, ServerBusy()),
        render_pool_(options.render_threads, options.max_waiting_pictures, RenderQueueFull()),
        hub_(jobs),
        scenes_(jobs, engine),
        reconstruction_(jobs, &hub_, &store_pool_),
        render_(&scenes_, &render_pool_, options.render),
        model_(&scenes_, &render_pool_, jobs->data().tmp()) {}

  ~GrpcServer() override { Shutdown(); }

  absl::Status Start(const std::string& listen) {
    grpc::EnableDefaultHealthCheckService(true);
    grpc::reflection::InitProtoReflectionServerBuilderPlugin();
    grpc::ServerBuilder builder;
    builder.RegisterService(&reconstruction_);
    builder.RegisterService(&render_);
    builder.RegisterService(&model_);
    builder.SetMaxReceiveMessageSize(kMaxReceiveBytes);
    builder.SetMaxSendMessageSize(kMaxSendBytes);
    builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIME_MS, kKeepaliveMs);
    builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, kKeepaliveMs);
    builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_PERMIT_WITHOUT_CALLS, 1);
    builder.AddChannelArgument(GRPC_ARG_HTTP2_MIN_RECV_PING_INTERVAL_WITHOUT_DATA_MS,
                               kMinPingIntervalMs);
    // A second server on the port is an error, not a silent share of its calls.
    builder.AddChannelArgument(GRPC_ARG_ALLOW_REUSEPORT, 0);
    if (!listen.empty()) {
      builder.AddListeningPort(listen, grpc::InsecureServerCredentials(), &port_);
    }
    server_ = builder.BuildAndStart();
    if (!server_ || (!listen.empty() && port_ == 0)) {
      return MakeError(absl::StatusCode::kUnavailable, "CANNOT_LISTEN", "listen",
                       absl::StrCat("cannot listen on ", listen,
                                    "; is another server running there? choose another --listen"));
    }
    for (const char* service :
         {v1::ReconstructionService::service_full_name(), v1::RenderService::service_full_name(),
          v1::ModelService::service_full_name()}) {
      server_->GetHealthCheckService()->SetServingStatus(service, true);
    }
    return absl::OkStatus();
  }

  int port() const override { return port_; }

  std::shared_ptr<grpc::Channel> InProcessChannel() override {
    grpc::ChannelArguments arguments;
    arguments.SetMaxReceiveMessageSize(-1);
    return server_->InProcessChannel(arguments);
  }

  void Shutdown() override {
    if (!server_) return;
    server_->GetHealthCheckService()->SetServingStatus(false);
    hub_.Stop();
    server_->Shutdown(std::chrono::system_clock::now() + kShutdownGrace);
    server_->Wait();
    server_.reset();
  }

 private:
  // Order matters: the pools go last, since tasks on them end calls to the services.
  ThreadPool store_pool_, render_pool_;
  EventHub hub_;
  SceneCache scenes_;
  ReconstructionServiceImpl reconstruction_;
  RenderServiceImpl render_;
  ModelServiceImpl model_;
  std::unique_ptr<grpc::Server> server_;
  int port_ = 0;
};

}  // namespace

absl::StatusOr<std::unique_ptr<Server>> StartServer(const ServerOptions& options, Jobs* jobs,
                                                    Engine* engine) {
  auto server = std::make_unique<GrpcServer>(options, jobs, engine);
  LITAGS_RETURN_IF_ERROR(server->Start(options.listen));
  return std::unique_ptr<Server>(std::move(server));
}

}  // namespace litags
