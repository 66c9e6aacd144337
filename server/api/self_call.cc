#include "server/api/self_call.h"

#include <grpcpp/create_channel.h>
#include <grpcpp/generic/generic_stub.h>
#include <grpcpp/security/tls_certificate_verifier.h>
#include <grpcpp/security/tls_credentials_options.h>
#include <spdlog/spdlog.h>

#include <chrono>
#include <memory>
#include <vector>

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

}  // namespace

SelfCall::SelfCall(SelfCallOptions options, std::function<void()> on_deaf)
    : options_(std::move(options)), on_deaf_(std::move(on_deaf)), thread_([this] { Loop(); }) {}

SelfCall::~SelfCall() {
  stop_.Cancel();
  thread_.join();
}

void SelfCall::Loop() {
  constexpr std::chrono::milliseconds kStep{50};
  bool answered_once = false;
  int failures = 0;
  while (!stop_.IsCancelled()) {
    const auto next =
        std::chrono::steady_clock::now() + std::chrono::duration<double>(options_.every_seconds);
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
    while (!stop_.IsCancelled() && std::chrono::steady_clock::now() < next) {
      std::this_thread::sleep_for(kStep);
    }
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
  return status.ok();
}

}  // namespace litags
