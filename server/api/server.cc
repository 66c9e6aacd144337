#include "server/api/server.h"

#include <grpcpp/ext/proto_server_reflection_plugin.h>
#include <grpcpp/grpcpp.h>
#include <grpcpp/health_check_service_interface.h>
#include <grpcpp/resource_quota.h>

#include <chrono>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "server/api/call_door.h"
#include "server/api/credentials.h"
#include "server/api/event_hub.h"
#include "server/api/gate.h"
#include "server/api/grpc_log.h"
#include "server/api/grpc_order.h"
#include "server/api/model_service.h"
#include "server/api/reconstruction_service.h"
#include "server/api/scene_cache.h"
#include "server/api/status.h"
#include "server/api/thread_pool.h"
#include "server/net/address.h"
#include "server/net/listener.h"

namespace litags {
namespace {

constexpr std::chrono::seconds kShutdownGrace{1};

// Archives that are unpacked at one time, also while their clients' turn is to come.
constexpr int kMaxArchives = 16;

int Ms(double seconds) { return static_cast<int>(1000 * seconds); }

// Before it is asked who can reach an address: "foo" is none.
absl::Status CheckAddress(const std::string& listen, std::string_view flag) {
  if (listen.empty() || IsUnixSocket(listen)) return absl::OkStatus();
  const HostPort parts = SplitHostPort(listen);
  int port = 0;
  if (!parts.host.empty() && absl::SimpleAtoi(parts.port, &port) && port >= 0 && port <= 65535) {
    return absl::OkStatus();
  }
  return InvalidInput("CANNOT_LISTEN", flag,
                      absl::StrCat("\"", listen,
                                   "\" is not of the form HOST:PORT; give one, such as "
                                   "127.0.0.1:50051"));
}

ConnectionCounts CountsOf(const ConnectionLimits& limits) {
  ConnectionCounts counts = limits.counts;
  counts.calls.of_connection = limits.max_calls;
  return counts;
}

// Compressed requests are refused, and none is unpacked before that: 1 MB may become 1 GB.
void RefuseCompression(grpc::ServerBuilder* builder) {
  builder->SetCompressionAlgorithmSupportStatus(GRPC_COMPRESS_DEFLATE, false);
  builder->SetCompressionAlgorithmSupportStatus(GRPC_COMPRESS_GZIP, false);
  builder->AddChannelArgument(GRPC_ARG_ENABLE_PER_MESSAGE_DECOMPRESSION, 0);
}

void SetLimits(const ConnectionLimits& limits, grpc::ServerBuilder* builder) {
  builder->SetMaxReceiveMessageSize(limits.max_receive_bytes);
  builder->SetMaxSendMessageSize(limits.max_send_bytes);
  builder->AddChannelArgument(GRPC_ARG_MAX_METADATA_SIZE, limits.max_header_bytes);
  builder->AddChannelArgument(GRPC_ARG_SERVER_HANDSHAKE_TIMEOUT_MS,
                              Ms(limits.counts.newcomer_seconds));
  builder->SetResourceQuota(grpc::ResourceQuota("litags").Resize(limits.max_memory_bytes));
  builder->AddChannelArgument(GRPC_ARG_MAX_CONCURRENT_STREAMS, limits.max_calls);
  builder->AddChannelArgument(GRPC_ARG_KEEPALIVE_TIME_MS, Ms(limits.keepalive_seconds));
  builder->AddChannelArgument(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, Ms(limits.keepalive_timeout_seconds));
  builder->AddChannelArgument(GRPC_ARG_KEEPALIVE_PERMIT_WITHOUT_CALLS, 1);
  builder->AddChannelArgument(GRPC_ARG_HTTP2_MIN_RECV_PING_INTERVAL_WITHOUT_DATA_MS,
                              Ms(limits.min_ping_seconds));
  builder->AddChannelArgument(GRPC_ARG_HTTP2_MAX_PING_STRIKES, 2);
  builder->AddChannelArgument(GRPC_ARG_MAX_CONNECTION_IDLE_MS, Ms(limits.max_idle_seconds));
}

class GrpcServer : public Server {
 public:
  GrpcServer(const ServerOptions& options, std::unique_ptr<Authenticator> authenticator, Jobs* jobs,
             Engine* engine)
      : authenticator_(std::move(authenticator)),
        connections_(CountsOf(options.connections)),
        door_(authenticator_.get(), &connections_),
        gate_(jobs, authenticator_.get(), &metrics_, &connections_, options.limits,
              options.requests, options.answers, options.connections.max_wait_seconds),
        upload_cpu_(options.upload_cpu),
        archives_(kMaxArchives),
        store_pool_(options.store_threads, options.max_waiting_calls, ServerBusy()),
        // What takes long for one client leaves a thread for the others.
        blob_pool_(options.blob_threads, options.max_waiting_calls, ServerBusy(),
                   options.blob_threads - 1),
        render_pool_(options.render_threads, options.max_waiting_pictures,
                     RenderQueueFull(options.max_waiting_pictures)),
        // One at a time: an export may take minutes, and more memory than all pictures together.
        export_pool_(1, options.max_waiting_pictures,
                     RenderQueueFull(options.max_waiting_pictures)),
        load_pool_(1, options.max_waiting_pictures, RenderQueueFull(options.max_waiting_pictures)),
        own_reader_(options.reader ? nullptr : MakeInProcessReader()),
        hub_(jobs),
        scenes_(engine, options.scene_cache_bytes, &load_pool_),
        reconstruction_(&gate_, &hub_, &store_pool_,
                        {&blob_pool_, options.reader ? options.reader : own_reader_.get(),
                         &upload_cpu_, &archives_}),
        render_(&gate_, &scenes_, &render_pool_, options.render),
        model_(&gate_, &scenes_, &export_pool_, &render_pool_, jobs->data().tmp(),
               options.answers.max_export_bytes, options.render.threads) {}

  ~GrpcServer() override { Shutdown(); }

  // `tls`: null: plaintext.
  absl::Status Start(const std::string& listen, const ConnectionLimits& limits,
                     std::unique_ptr<TlsFiles> tls) {
    credentials_ = tls ? TlsCredentials(std::move(tls), door_.AtHeaders())
                       : PlainCredentials(door_.AtHeaders());
    LogGrpc();
    grpc::EnableDefaultHealthCheckService(true);
    grpc::reflection::InitProtoReflectionServerBuilderPlugin();
    grpc::ServerBuilder builder;
    builder.RegisterService(&reconstruction_);
    builder.RegisterService(&render_);
    builder.RegisterService(&model_);
    std::vector<std::unique_ptr<grpc::experimental::ServerInterceptorFactoryInterface>> whole;
    whole.push_back(door_.WhenWhole());
    builder.experimental().SetInterceptorCreators(std::move(whole));
    SetLimits(limits, &builder);
    RefuseCompression(&builder);
    std::shared_ptr<Acceptor> acceptor;
    if (IsUnixSocket(listen)) {
      builder.AddListeningPort(listen, credentials_, &port_);
    } else if (!listen.empty()) {
      LITAGS_ASSIGN_OR_RETURN(listener_, Listener::Open(listen, limits.keepalive_timeout_seconds));
      port_ = listener_->port();
      acceptor = builder.experimental().AddExternalConnectionAcceptor(
          grpc::ServerBuilder::experimental_type::ExternalConnectionType::FROM_FD, credentials_);
    }
    BeforeStart(&gate_);
    server_ = builder.BuildAndStart();
    if (!server_ || (!listen.empty() && port_ == 0)) {
      return MakeError(absl::StatusCode::kUnavailable, "CANNOT_LISTEN", "--listen",
                       absl::StrCat("cannot listen on ", listen,
                                    "; is another server running there? choose another --listen"));
    }
    SetHealth({});
    if (listener_) {
      listener_->Start(&connections_, [acceptor](int listener, int fd) {
        Acceptor::NewConnectionParameters connection;
        connection.listener_fd = listener;
        connection.fd = fd;
        acceptor->HandleNewConnection(&connection);
      });
    }
    return absl::OkStatus();
  }

  void SetHealth(const Health& health) override {
    grpc::HealthCheckServiceInterface* service = server_->GetHealthCheckService();
    const bool all = health.store && health.workers;
    service->SetServingStatus("", all);
    service->SetServingStatus(v1::ReconstructionService::service_full_name(), all);
    service->SetServingStatus(v1::RenderService::service_full_name(), health.store);
    service->SetServingStatus(v1::ModelService::service_full_name(), health.store);
  }

  SharedRoom* unread() override { return gate_.unread(); }

  Metrics* metrics() override { return &metrics_; }

  int port() const override { return port_; }

  std::string own_address() const override { return listener_ ? listener_->own_address() : ""; }

  std::shared_ptr<grpc::Channel> InProcessChannel() override {
    grpc::ChannelArguments arguments;
    arguments.SetMaxReceiveMessageSize(-1);
    return server_->InProcessChannel(arguments);
  }

  void Shutdown() override {
    if (!server_) return;
    server_->GetHealthCheckService()->SetServingStatus(false);
    hub_.Stop();
    // First: gRPC would keep, and never close, what came after its own end.
    if (listener_) listener_->Stop();
    server_->Shutdown(std::chrono::system_clock::now() + kShutdownGrace);
    server_->Wait();
    // All calls are over, but the tasks that ended them may still be returning.
    store_pool_.Stop();
    blob_pool_.Stop();
    load_pool_.Stop();  // its tasks go on there
    export_pool_.Stop();
    render_pool_.Stop();
    server_.reset();
  }

 private:
  using Acceptor = grpc::experimental::ExternalConnectionAcceptor;

  // Order matters: the pools go after the services, since tasks on them end calls, and the gate
  // last, which every call leaves through and is counted at.
  Metrics metrics_;
  const std::unique_ptr<Authenticator> authenticator_;
  Connections connections_;
  CallDoor door_;
  Gate gate_;
  CpuBudget upload_cpu_;  // before the threads that spend it
  SharedRoom archives_;
  ThreadPool store_pool_, blob_pool_, render_pool_, export_pool_, load_pool_;
  const std::unique_ptr<FileReader> own_reader_;
  EventHub hub_;
  SceneCache scenes_;
  ReconstructionServiceImpl reconstruction_;
  RenderServiceImpl render_;
  ModelServiceImpl model_;
  std::shared_ptr<grpc::ServerCredentials> credentials_;  // asked at every handshake
  std::unique_ptr<Listener> listener_;
  std::unique_ptr<grpc::Server> server_;
  int port_ = 0;
};

}  // namespace

absl::Status CheckListening(const ServerOptions& options) {
  return CheckListening(options, options.listen, "--listen");
}

absl::Status CheckListening(const ServerOptions& options, const std::string& listen,
                            std::string_view flag) {
  LITAGS_RETURN_IF_ERROR(CheckAddress(listen, flag));
  if (options.insecure || listen.empty() || IsLoopback(listen)) return absl::OkStatus();
  if (!options.tls.enabled()) {
    return MakeError(absl::StatusCode::kFailedPrecondition, "PLAINTEXT_NOT_ASKED_FOR", flag,
                     absl::StrCat(listen,
                                  " can be reached from other machines, and photos would travel "
                                  "unencrypted; give --tls-cert and --tls-key, or --insecure"));
  }
  if (!options.auth.enabled() && options.tls.client_ca.empty()) {
    return MakeError(absl::StatusCode::kFailedPrecondition, "NOBODY_IS_ASKED", flag,
                     absl::StrCat(listen,
                                  " can be reached from other machines, and everybody could use "
                                  "the server; give --tokens or --tls-client-ca, or --insecure"));
  }
  return absl::OkStatus();
}

absl::Status CheckMetricsListening(const std::string& listen, bool insecure) {
  LITAGS_RETURN_IF_ERROR(CheckAddress(listen, "--metrics-listen"));
  if (insecure || listen.empty() || IsLoopback(listen)) return absl::OkStatus();
  return MakeError(absl::StatusCode::kFailedPrecondition, "PLAINTEXT_NOT_ASKED_FOR",
                   "--metrics-listen",
                   absl::StrCat(listen,
                                " can be reached from other machines, and everybody could read the "
                                "metrics; listen on 127.0.0.1, or give --metrics-for-all"));
}

absl::StatusOr<std::unique_ptr<Server>> StartServer(const ServerOptions& options, Jobs* jobs,
                                                    Engine* engine) {
  LITAGS_RETURN_IF_ERROR(CheckListening(options));
  std::unique_ptr<TlsFiles> tls;
  if (options.tls.enabled()) {
    LITAGS_ASSIGN_OR_RETURN(tls, TlsFiles::Open(options.tls));
  }
  AuthOptions auth = options.auth;
  auth.client_certificates = !options.tls.client_ca.empty();
  LITAGS_ASSIGN_OR_RETURN(auto authenticator, Authenticator::Make(std::move(auth)));
  auto server = std::make_unique<GrpcServer>(options, std::move(authenticator), jobs, engine);
  LITAGS_RETURN_IF_ERROR(server->Start(options.listen, options.connections, std::move(tls)));
  return std::unique_ptr<Server>(std::move(server));
}

}  // namespace litags
