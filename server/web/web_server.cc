#include "server/web/web_server.h"

#include <spdlog/spdlog.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <boost/asio/executor_work_guard.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/strand.hpp>
#include <thread>
#include <vector>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "server/net/listener.h"
#include "server/web/api.h"
#include "server/web/assets.h"
#include "server/web/connection.h"
#include "server/web/failure.h"
#include "server/web/tls_context.h"

namespace litags::web {
namespace {

namespace asio = boost::asio;

// Connections wait on them, and hold none. What takes long happens on those of the services.
constexpr int kThreads = 2;
constexpr std::string_view kApiPrefix = "/v1/";

Answer Page(const Head& head) {
  const auto assets = Assets();
  const auto asset = std::find_if(assets.begin(), assets.end(),
                                  [&](const Asset& a) { return a.path == head.path; });
  if (asset == assets.end()) {
    return Failure(MakeError(absl::StatusCode::kNotFound, "ROUTE_UNKNOWN", "path",
                             "nothing is at this address; the page is at /"));
  }
  if (head.method != "GET" && head.method != "HEAD") return WrongMethod("GET, HEAD");
  Answer answer{200, std::string(asset->type), "", {}};
  // Asked for each time, sent when it is another.
  answer.headers.emplace_back("Cache-Control", "no-cache");
  answer.headers.emplace_back("ETag", asset->etag);
  if (head.Header("if-none-match") == asset->etag) {
    answer.code = 304;
  } else {
    answer.body = asset->bytes;
  }
  return answer;
}

asio::ip::tcp ProtocolOf(int fd) {
  sockaddr_storage address = {};
  socklen_t size = sizeof(address);
  getsockname(fd, reinterpret_cast<sockaddr*>(&address), &size);
  return address.ss_family == AF_INET6 ? asio::ip::tcp::v6() : asio::ip::tcp::v4();
}

Caller CallerOf(int fd) {
  sockaddr_storage address = {};
  socklen_t size = sizeof(address);
  getpeername(fd, reinterpret_cast<sockaddr*>(&address), &size);
  const Peer peer = PeerOf(address).value_or(Peer());
  return {peer, peer.Text(), peer.Network()};
}

}  // namespace

struct WebServer::Parts {
  Parts(const WebOptions& options, std::shared_ptr<grpc::Channel> channel, SharedRoom* unread)
      : connections(options.counts), api(std::move(channel), unread, options.local_only) {
    environment.limits = {.silence_seconds = options.silence_seconds,
                          .unread_seconds = options.unread_seconds};
    environment.handler = [this](Exchange& exchange) { return Handle(exchange); };
    environment.admit = [this](const Peer& peer) { connections.Admit(peer); };
  }

  asio::awaitable<void> Handle(Exchange& exchange) {
    if (exchange.head().path.starts_with(kApiPrefix)) {
      co_await api.Serve(exchange);
      co_return;
    }
    Answer answer = Page(exchange.head());
    co_await exchange.Send(std::move(answer));
  }

  // What the TLS files hold, if that is another thing than before. An error changes nothing.
  absl::Status TakeTls() {
    const auto renewed = tls_files->TakeRenewed();
    if (!renewed) return absl::OkStatus();
    LITAGS_ASSIGN_OR_RETURN(tls, MakeTlsContext(*renewed));
    return absl::OkStatus();
  }

  // On the listener's thread, which no exception may leave.
  void Take(int fd) {
    if (tls_files) {
      if (const absl::Status taken = TakeTls(); !taken.ok()) {
        spdlog::error("TLS of the page stays as it was: {}", std::string(taken.message()));
      }
    }
    asio::ip::tcp::socket socket(asio::make_strand(context));
    boost::system::error_code error;
    socket.assign(ProtocolOf(fd), fd, error);
    if (error) {
      close(fd);
      return;
    }
    ServeConnection(std::move(socket), tls, CallerOf(fd), &environment);
  }

  std::string scheme = "http";
  Connections connections;
  Api api;
  ConnectionEnvironment environment;
  std::unique_ptr<TlsFiles> tls_files;
  std::shared_ptr<asio::ssl::context> tls;
  asio::io_context context;
  asio::executor_work_guard<asio::io_context::executor_type> work = make_work_guard(context);
  std::unique_ptr<Listener> listener;
  std::vector<std::thread> threads;
};

absl::StatusOr<std::unique_ptr<WebServer>> WebServer::Start(const WebOptions& options,
                                                            std::shared_ptr<grpc::Channel> channel,
                                                            SharedRoom* unread) {
  auto parts = std::make_unique<Parts>(options, std::move(channel), unread);
  if (options.tls.enabled()) {
    LITAGS_ASSIGN_OR_RETURN(parts->tls_files, TlsFiles::Open(options.tls));
    LITAGS_RETURN_IF_ERROR(parts->TakeTls());
    parts->scheme = "https";
  }
  LITAGS_ASSIGN_OR_RETURN(
      parts->listener, Listener::Open(options.listen, options.keepalive_timeout_seconds, "--web"));
  return std::unique_ptr<WebServer>(new WebServer(std::move(parts)));
}

WebServer::WebServer(std::unique_ptr<Parts> parts) : parts_(std::move(parts)) {
  for (int i = 0; i < kThreads; ++i) {
    parts_->threads.emplace_back([context = &parts_->context] { context->run(); });
  }
  parts_->listener->Start(&parts_->connections,
                          [parts = parts_.get()](int, int fd) { parts->Take(fd); });
}

WebServer::~WebServer() { Stop(); }

int WebServer::port() const { return parts_->listener->port(); }

std::string WebServer::url() const {
  return absl::StrCat(parts_->scheme, "://", parts_->listener->own_address());
}

void WebServer::Stop() {
  parts_->listener->Stop();
  parts_->environment.stopping = true;
  parts_->connections.CutAll();
  parts_->work.reset();
  for (std::thread& thread : parts_->threads) thread.join();
  parts_->threads.clear();
}

}  // namespace litags::web
