// A connection to the page: what a browser or a stranger sends, as bytes. Its requests are parsed,
// guarded, routed and made calls of services that answer each with an empty message.
#include <google/protobuf/stubs/logging.h>
#include <grpcpp/generic/async_generic_service.h>
#include <grpcpp/server_builder.h>
#include <spdlog/spdlog.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/strand.hpp>
#include <boost/beast/core/error.hpp>
#include <boost/beast/http/parser.hpp>
#include <boost/beast/http/string_body.hpp>
#include <chrono>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <string_view>

#include "absl/strings/ascii.h"
#include "engine/core/check.h"
#include "server/auth/request_id.h"
#include "server/net/shared_room.h"
#include "server/web/api.h"
#include "server/web/connection.h"
#include "tests/fuzz/fuzz_support.h"

namespace litags::web {
namespace {

namespace asio = boost::asio;
namespace http = boost::beast::http;

constexpr size_t kMaxInput = 64 << 10;  // a socket takes it at once
// A connection on which nothing happened for so long waits for bytes that do not come.
constexpr std::chrono::milliseconds kQuiet{2};

// Reads all of a call, then answers with an empty message.
class EmptyAnswer : public grpc::ServerGenericBidiReactor {
 public:
  EmptyAnswer() { StartRead(&in_); }

  void OnReadDone(bool ok) override {
    if (ok) {
      StartRead(&in_);
      return;
    }
    const grpc::Slice nothing;
    out_ = grpc::ByteBuffer(&nothing, 1);
    StartWriteAndFinish(&out_, grpc::WriteOptions(), grpc::Status::OK);
  }
  void OnDone() override { delete this; }

 private:
  grpc::ByteBuffer in_, out_;
};

class EmptyAnswers : public grpc::CallbackGenericService {
  grpc::ServerGenericBidiReactor* CreateReactor(grpc::GenericCallbackServerContext*) override {
    return new EmptyAnswer;
  }
};

// The gateway, and the other ends of its connections.
class Gateway {
 public:
  Gateway() {
    spdlog::set_level(spdlog::level::off);
    google::protobuf::SetLogHandler(nullptr);
    grpc::ServerBuilder builder;
    builder.RegisterCallbackGenericService(&services_);
    server_ = builder.BuildAndStart();
    api_ = std::make_unique<Api>(server_->InProcessChannel({}), &unread_, /*local_only=*/true);
    environment_.handler = [this](Exchange& exchange) { return api_->Serve(exchange); };
    environment_.admit = [](const Peer&) {};
  }

  // What a connection answers to these bytes, which are all that it gets.
  std::string Answer(std::string_view bytes) {
    int ends[2] = {};
    LITAGS_CHECK(socketpair(AF_UNIX, SOCK_STREAM, 0, ends) == 0);
    LITAGS_CHECK(write(ends[1], bytes.data(), bytes.size()) == static_cast<ssize_t>(bytes.size()));
    context_.restart();
    asio::ip::tcp::socket ours(asio::make_strand(context_)), client(context_);
    ours.assign(asio::ip::tcp::v4(), ends[0]);
    client.assign(asio::ip::tcp::v4(), ends[1]);
    ServeConnection(std::move(ours), nullptr, {}, &environment_);
    std::string answer;
    Collect(client, &answer);
    while (context_.run_one_for(kQuiet) > 0) {
    }
    boost::system::error_code ignored;
    client.shutdown(asio::ip::tcp::socket::shutdown_send, ignored);
    context_.run();
    return answer;
  }

 private:
  void Collect(asio::ip::tcp::socket& client, std::string* answer) {
    client.async_read_some(asio::buffer(piece_),
                           [this, &client, answer](boost::system::error_code error, size_t size) {
                             answer->append(piece_.data(), size);
                             if (!error) Collect(client, answer);
                           });
  }

  EmptyAnswers services_;
  std::unique_ptr<grpc::Server> server_;
  SharedRoom unread_{64 << 20};
  std::unique_ptr<Api> api_;
  ConnectionEnvironment environment_;
  asio::io_context context_;
  std::array<char, 64 << 10> piece_;
};

// Headers that answers may have: no other is let in by what a request holds.
void CheckHeader(std::string_view name, std::string_view value) {
  static const std::set<std::string> kNames = {"allow",
                                               "cache-control",
                                               "connection",
                                               "content-length",
                                               "content-type",
                                               "content-disposition",
                                               "litags-answer",
                                               "retry-after",
                                               "referrer-policy",
                                               "set-cookie",
                                               "transfer-encoding",
                                               "cross-origin-opener-policy",
                                               "www-authenticate",
                                               "x-content-type-options",
                                               "cross-origin-resource-policy",
                                               "x-frame-options",
                                               "content-security-policy",
                                               "x-request-id"};
  LITAGS_CHECK(kNames.contains(absl::AsciiStrToLower(std::string(name))));
  if (name == "Set-Cookie") LITAGS_CHECK(value.starts_with("litags_token"));
  if (name == kRequestIdHeader) LITAGS_CHECK(RequestIdOf(value) == value);
}

// The first answer; where the others begin depends on the requests' methods. `has_body`: it is not
// to HEAD.
void CheckFirst(std::string_view text, bool has_body) {
  constexpr std::string_view kContinue = "HTTP/1.1 100 Continue\r\n\r\n";
  if (text.starts_with(kContinue)) text.remove_prefix(kContinue.size());
  if (text.empty()) return;  // the request was no whole one
  http::response_parser<http::string_body> parser;
  parser.eager(true);
  boost::system::error_code error;
  parser.put(asio::buffer(text), error);
  LITAGS_CHECK(parser.is_header_done());
  const auto& answer = parser.get();
  for (const auto& field : answer) {
    CheckHeader({field.name_string().data(), field.name_string().size()},
                {field.value().data(), field.value().size()});
  }
  LITAGS_CHECK(answer.count("Content-Security-Policy") == 1);
  const bool whole = parser.is_done() && answer["Content-Type"] == "application/json";
  if (whole && has_body) LITAGS_CHECK(nlohmann::json::accept(answer.body()));
}

}  // namespace
}  // namespace litags::web

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static auto* const gateway = new litags::web::Gateway;  // never ends: gRPC's threads use it
  if (size > litags::web::kMaxInput) return 0;
  const std::string_view text = litags::AsText(data, size);
  litags::web::CheckFirst(gateway->Answer(text), text.find("HEAD") == std::string_view::npos);
  return 0;
}
