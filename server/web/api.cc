#include "server/web/api.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <boost/asio/this_coro.hpp>
#include <nlohmann/json.hpp>
#include <string_view>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/core/json_text.h"
#include "engine/core/utf8.h"
#include "litags/v1/reconstruction_service.pb.h"
#include "server/auth/request_id.h"
#include "server/errors/to_grpc.h"
#include "server/net/line_rate.h"
#include "server/net/peer.h"
#include "server/web/failure.h"
#include "server/web/guard.h"
#include "server/web/transcode.h"

namespace litags::web {
namespace {

namespace asio = boost::asio;

// As gRPC's limit of a message.
constexpr size_t kMaxBodyBytes = 2 << 20;
constexpr size_t kMaxTokenBody = 4 << 10;
constexpr char kSessionPath[] = "/v1/session";

Answer Json(std::string body) { return {200, "application/json", std::move(body), {}}; }

// What a field of bytes is, by its first ones.
std::string TypeOf(std::string_view bytes) {
  if (bytes.starts_with("\x89PNG")) return "image/png";
  if (bytes.starts_with("\xff\xd8\xff")) return "image/jpeg";
  return "application/octet-stream";
}

// The field `data` as the body, all else as a header.
Answer Bytes(google::protobuf::Message* message) {
  const auto* field = message->GetDescriptor()->FindFieldByName("data");
  const auto* reflection = message->GetReflection();
  Answer answer;
  answer.body = reflection->GetString(*message, field);
  answer.type = TypeOf(answer.body);
  reflection->ClearField(message, field);
  if (auto rest = JsonOf(*message); rest.ok()) {
    answer.headers.emplace_back("Litags-Answer", *std::move(rest));
  }
  return answer;
}

// A token to try, from {"token": "..."}; empty if there is none that a cookie could hold.
std::string TokenIn(std::string_view body) {
  const auto parsed = ParseJson(body);
  if (!parsed.is_object() || !parsed.contains("token") || !parsed["token"].is_string()) return "";
  std::string token = parsed["token"].get<std::string>();
  return IsCookieValue(token) ? token : "";
}

void LogRefusal(const Head& head, const grpc::Status& status) {
  std::string ending;
  if (!CallerLines().Pass(absl::StrCat("web/", status.error_code(), "/", head.network), &ending)) {
    return;
  }
  spdlog::info("peer={} {} {} {}{}", head.peer, head.method, Utf8Prefix(head.path, 200),
               status.error_message(), ending);
}

}  // namespace

asio::awaitable<void> Api::Serve(Exchange& exchange) {
  absl::Status allowed = CheckSite(exchange.head());
  if (allowed.ok() && local_only_) allowed = CheckLocalHost(exchange.head());
  if (!allowed.ok()) {
    LogRefusal(exchange.head(), ToGrpc(allowed));
    Answer refused = Failure(allowed);
    co_await exchange.Send(std::move(refused));
    co_return;
  }
  if (exchange.head().path == kSessionPath) {
    co_await Session(exchange);
  } else {
    co_await Dispatch(exchange);
  }
}

asio::awaitable<void> Api::Dispatch(Exchange& exchange) {
  std::string methods;
  const Match match = FindRoute(exchange.head(), &methods);
  if (match.route) {
    co_await Call(exchange, match);
    co_return;
  }
  Answer refused;
  if (methods.empty()) {
    refused = Failure(MakeError(absl::StatusCode::kNotFound, "ROUTE_UNKNOWN", "path",
                                "nothing is at this address; docs/web.md lists the routes"));
  } else {
    refused = WrongMethod(methods);
  }
  co_await exchange.Send(std::move(refused));
}

// POST: the cookie for a token that the services let in. DELETE: no cookie.
asio::awaitable<void> Api::Session(Exchange& exchange) {
  const Head& head = exchange.head();
  Answer answer = Json("{}");
  if (head.method == "DELETE") {
    answer.headers.emplace_back("Set-Cookie", NoSessionCookie(head));
  } else if (head.method == "POST") {
    const absl::StatusOr<std::string> body = co_await exchange.ReadBody(kMaxTokenBody);
    const std::string token = body.ok() ? TokenIn(*body) : "";
    const v1::GetServerInfoRequest request;
    v1::ServerInfo info;
    const std::string authorization = absl::StrCat("Bearer ", token);
    const grpc::Status status = co_await Unary(exchange, kInfoRpc, authorization, request, &info);
    if (status.ok()) {
      answer.headers.emplace_back("Set-Cookie", SessionCookie(head, token));
    } else {
      answer = Failure(status);
    }
  } else {
    answer = WrongMethod("POST, DELETE");
  }
  co_await exchange.Send(std::move(answer));
}

asio::awaitable<void> Api::Call(Exchange& exchange, const Match& match) {
  if (match.route->kind == AnswerKind::kUpload) {
    co_await Upload(exchange, match);
    co_return;
  }
  absl::StatusOr<std::string> body = co_await exchange.ReadBody(kMaxBodyBytes);
  if (!body.ok()) {
    const bool large = body.status().code() == absl::StatusCode::kResourceExhausted;
    Answer refused = Failure(body.status(), large ? 413 : 0);
    co_await exchange.Send(std::move(refused));
    co_return;
  }
  const auto request = RequestOf(match, exchange.head(), *body);
  if (!request.ok()) {
    Answer refused = Failure(request.status());
    co_await exchange.Send(std::move(refused));
    co_return;
  }
  switch (match.route->kind) {
    case AnswerKind::kEvents:
      co_await Events(exchange, *match.route, **request);
      break;
    case AnswerKind::kReport:
      co_await Report(exchange, *match.route, **request);
      break;
    case AnswerKind::kDownload:
      co_await Download(exchange, *match.route, **request);
      break;
    default:
      co_await Whole(exchange, *match.route, **request);
  }
}

// A call with one answer, which is sent as a whole.
asio::awaitable<void> Api::Whole(Exchange& exchange, const Route& route, const Message& request) {
  const bool bytes = route.kind == AnswerKind::kBytes;
  Answer answer;
  std::unique_ptr<Message> message = NewResponse(route);
  HeldRoom held;  // until it is sent
  const std::string authorization = AuthorizationOf(exchange.head());
  const grpc::Status status =
      co_await Unary(exchange, route.rpc, authorization, request, message.get(), &held);
  if (!status.ok()) {
    answer = Failure(status);
  } else if (bytes) {
    answer = Bytes(message.get());
  } else {
    absl::StatusOr<std::string> json = JsonOf(*message);
    answer = json.ok() ? Json(*std::move(json)) : Failure(json.status());
  }
  message.reset();  // clients may take long to read the answer, which has all of it
  answer.headers.emplace_back("Cache-Control", "no-store");
  co_await exchange.Send(std::move(answer));
}

std::unique_ptr<RpcCall> Api::Begin(Exchange& exchange, std::string_view rpc,
                                    asio::any_io_executor executor,
                                    const std::string& authorization) {
  std::multimap<std::string, std::string> metadata;
  const auto is_header = [](std::string_view value) {
    return !value.empty() && std::all_of(value.begin(), value.end(),
                                         [](unsigned char c) { return c >= 0x20 && c < 0x7f; });
  };
  if (is_header(authorization)) metadata.emplace("authorization", authorization);
  metadata.emplace(kRequestIdHeader, exchange.head().request_id);
  metadata.emplace(kPeerHeader, exchange.head().peer);
  return std::make_unique<RpcCall>(
      &stub_, rpc, metadata, std::move(executor), [&exchange] { return exchange.Gone(); }, unread_);
}

asio::awaitable<grpc::Status> Api::Unary(Exchange& exchange, std::string_view rpc,
                                         const std::string& authorization, const Message& request,
                                         Message* answer, HeldRoom* held) {
  const asio::any_io_executor executor = co_await asio::this_coro::executor;
  const auto call = Begin(exchange, rpc, executor, authorization);
  co_await call->WriteLast(request);
  co_await call->Read(answer);
  if (held) *held = call->TakeHeld();
  const grpc::Status status = co_await call->Finish();
  if (call->let_in()) {
    exchange.Admit();
  } else if (status.error_code() == grpc::UNAUTHENTICATED) {
    LogRefusal(exchange.head(), status);
  }
  co_return status;
}

}  // namespace litags::web
