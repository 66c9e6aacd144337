#include "server/api/self_call.h"

#include <grpcpp/create_channel.h>
#include <grpcpp/generic/generic_stub.h>
#include <grpcpp/security/tls_certificate_verifier.h>
#include <grpcpp/security/tls_credentials_options.h>
#include <netdb.h>
#include <spdlog/spdlog.h>
#include <sys/socket.h>
#include <unistd.h>

#include <chrono>
#include <memory>
#include <vector>

#include "server/net/address.h"

namespace litags {
namespace {

namespace tls = grpc::experimental;

// Whom it talks to is no question: its own address. So certificates are not checked, only shown.
std::shared_ptr<grpc::ChannelCredentials> Credentials(const TlsOptions& options) {
  if (!options.enabled()) return grpc::InsecureChannelCredentials();
  tls::TlsChannelCredentialsOptions unchecked;
  unchecked.set_verify_server_certs(false);
  unchecked.set_check_call_host(false);
  unchecked.set_certificate_verifier(std::make_shared<tls::NoOpCertificateVerifier>());
  const auto files =
      options.client_ca.empty() ? absl::StatusOr<TlsMaterial>(TlsMaterial()) : LoadTls(options);
  if (files.ok() && !files->key.empty()) {
    unchecked.set_certificate_provider(std::make_shared<tls::StaticDataCertificateProvider>(
        std::vector<tls::IdentityKeyCertPair>{{files->key, files->cert}}));
    unchecked.watch_identity_key_cert_pairs();
  }
  return tls::TlsCredentials(unchecked);
}

// Whether a TCP connection to HOST:PORT, an address of this machine, is taken.
bool TakesConnections(const std::string& address) {
  const auto [host, port] = SplitHostPort(address);
  addrinfo hints = {}, *found = nullptr;
  hints.ai_socktype = SOCK_STREAM;
  hints.ai_flags = AI_NUMERICSERV;
  if (getaddrinfo(host.c_str(), port.c_str(), &hints, &found) != 0) return false;
  bool taken = false;
  for (const addrinfo* at = found; at && !taken; at = at->ai_next) {
    const int fd = socket(at->ai_family, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (fd < 0) continue;
    const timeval patience = {1, 0};  // a full queue of connections drops this one
    setsockopt(fd, SOL_SOCKET, SO_SNDTIMEO, &patience, sizeof(patience));
    taken = connect(fd, at->ai_addr, at->ai_addrlen) == 0;
    close(fd);
  }
  freeaddrinfo(found);
  return taken;
}

}  // namespace

SelfCall::SelfCall(SelfCallOptions options, std::function<void()> on_deaf)
    : options_(std::move(options)), on_deaf_(std::move(on_deaf)), thread_([this] { Loop(); }) {}

SelfCall::~SelfCall() {
  stop_.Cancel();
  thread_.join();
}

void SelfCall::Loop() {
  using SteadyClock = std::chrono::steady_clock;
  bool answered_once = false;
  int failures = 0;
  while (!stop_.IsCancelled()) {
    const auto start = SteadyClock::now();
    const bool answered = IsAnswered();
    if (stop_.IsCancelled()) return;
    answered_once = answered_once || answered;
    failures = answered ? 0 : failures + 1;
    if (failures > 0) {
      spdlog::warn("the server does not answer at {}: call {} of {}", options_.address, failures,
                   options_.failures);
    }
    if (failures >= options_.failures) {
      if (answered_once) return on_deaf_();
      spdlog::warn("the server cannot call itself at {}: nobody watches whether it answers",
                   options_.address);
      return;
    }
    const std::chrono::duration<double> took = SteadyClock::now() - start;
    stop_.SleepFor(options_.every_seconds - took.count());
  }
}

bool SelfCall::IsAnswered() const {
  grpc::ChannelArguments arguments;
  arguments.SetInt(GRPC_ARG_ENABLE_HTTP_PROXY, 0);
  arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);  // a new connection each time
  const auto channel =
      grpc::CreateCustomChannel(options_.address, Credentials(options_.tls), arguments);
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() +
                       std::chrono::milliseconds(int64_t(1000 * options_.timeout_seconds)));
  // A HealthCheckRequest of all services together: no bytes. What it answers is another question.
  grpc::Slice nothing("");
  grpc::ByteBuffer request(&nothing, 1), response;
  grpc::CompletionQueue queue;
  const auto call = grpc::GenericStub(channel).PrepareUnaryCall(
      &context, "/grpc.health.v1.Health/Check", request, &queue);
  call->StartCall();
  grpc::Status status;
  call->Finish(&response, &status, &context);
  void* tag = nullptr;
  bool ok = false;
  while (queue.AsyncNext(&tag, &ok,
                         std::chrono::system_clock::now() + std::chrono::milliseconds(50)) ==
         grpc::CompletionQueue::TIMEOUT) {
    if (stop_.IsCancelled()) context.TryCancel();
  }
  // A deaf server says nothing, or does not listen. One that refuses the connection or the call is
  // alive: after a change of --tls-client-ca it refuses the certificate that is shown here.
  switch (status.error_code()) {
    case grpc::StatusCode::DEADLINE_EXCEEDED:
    case grpc::StatusCode::CANCELLED:
      return false;
    case grpc::StatusCode::UNAVAILABLE:
      return TakesConnections(options_.address);
    default:
      return true;
  }
}

}  // namespace litags
