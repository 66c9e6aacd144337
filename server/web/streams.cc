// Calls whose answers come in pieces.
#include <google/protobuf/descriptor.h>

#include <boost/asio/this_coro.hpp>
#include <string_view>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "litags/v1/model_service.pb.h"
#include "litags/v1/reconstruction_service.pb.h"
#include "proto/litags/v1/limits.h"
#include "server/errors/to_grpc.h"
#include "server/web/api.h"
#include "server/web/failure.h"
#include "server/web/guard.h"
#include "server/web/transcode.h"

namespace litags::web {
namespace {

namespace asio = boost::asio;
using google::protobuf::Message;

// A stream without events says so often that it is there: proxies give up what is silent.
constexpr double kQuietSeconds = 15;
// A call that was not refused by then is a stream.
constexpr double kRefusedSeconds = 1;

// Continues after the event that the browser saw last. False: the header is no number.
bool Resume(const Head& head, std::string_view field, Message* request) {
  const std::string_view last = head.Header("last-event-id");
  if (last.empty() || field.empty()) return true;
  int64_t number = 0;
  if (!absl::SimpleAtoi(absl::string_view(last.data(), last.size()), &number)) return false;
  request->GetReflection()->SetInt64(
      request, request->GetDescriptor()->FindFieldByName(std::string(field)), number);
  return true;
}

// JSON has no line ends outside of texts, and escapes them there.
absl::StatusOr<std::string> EventText(const Message& message) {
  LITAGS_ASSIGN_OR_RETURN(const std::string json, JsonOf(message));
  const auto* number = message.GetDescriptor()->FindFieldByName("number");
  if (!number) return absl::StrCat("data: ", json, "\n\n");
  return absl::StrCat("id: ", message.GetReflection()->GetInt64(message, number), "\ndata: ", json,
                      "\n\n");
}

// The value of Content-Disposition for the file that was asked for.
std::string AttachmentOf(const Message& request) {
  v1::ExportModelRequest asked;
  asked.CopyFrom(request);
  const auto format = static_cast<size_t>(asked.format());
  return web::AttachmentOf(asked.name(),
                           v1::kModelEndings[format < v1::kModelEndings.size() ? format : 0]);
}

// What a stream's end is told by: browsers open one again that only stops.
std::string LastEvent(const grpc::Status& status) {
  if (status.ok()) return "event: end\ndata: {}\n\n";
  return absl::StrCat("event: failure\ndata: ", FailureJson(status), "\n\n");
}

}  // namespace

asio::awaitable<void> Api::Events(Exchange& exchange, const Route& route, const Message& request) {
  const std::unique_ptr<Message> resumed = NewRequest(route);
  resumed->CopyFrom(request);
  if (!Resume(exchange.head(), route.resume_field, resumed.get())) {
    Answer refused = Failure(InvalidInput("EVENT_NUMBER_INVALID", "Last-Event-ID",
                                          "Last-Event-ID is no number; send that of an event"));
    co_await exchange.Send(std::move(refused));
    co_return;
  }
  const asio::any_io_executor executor = co_await asio::this_coro::executor;
  const std::string authorization = AuthorizationOf(exchange.head());
  const auto call = Begin(exchange, route.rpc, executor, authorization);
  co_await call->WriteLast(*resumed);
  std::unique_ptr<Message> message = NewResponse(route);
  RpcCall::Got got = co_await call->Read(message.get(), kRefusedSeconds);
  if (call->let_in()) {
    exchange.Admit();
  } else if (got == RpcCall::Got::kNothingYet) {
    // Whether the caller is let in, which admits it: a quiet stream says so with its first event.
    const v1::GetServerInfoRequest look;
    v1::ServerInfo info;
    co_await Unary(exchange, kInfoRpc, authorization, look, &info);
  }
  if (got == RpcCall::Got::kEnd) {
    const grpc::Status refusal = co_await call->Finish();
    if (!refusal.ok()) {
      Answer refused = Failure(refusal);
      co_await exchange.Send(std::move(refused));
      co_return;
    }
  }
  Answer head{200, "text/event-stream", "", {{"Cache-Control", "no-store"}}};
  bool open = co_await exchange.Begin(std::move(head), std::nullopt);
  while (open && got != RpcCall::Got::kEnd) {
    std::string text = ":\n\n";
    if (got == RpcCall::Got::kMessage) {
      absl::StatusOr<std::string> event = EventText(*message);
      text = event.ok() ? *std::move(event) : LastEvent(ToGrpc(event.status()));
      message = NewResponse(route);  // it may be a picture, and the client slow to read
    }
    open = co_await exchange.SendPiece(text);
    if (!open) co_return;
    text = std::string();  // the next event may take long to come
    got = co_await call->Read(message.get(), kQuietSeconds);
  }
  const grpc::Status status = co_await call->Finish();
  // The server's end, or the client's: it comes again.
  if (status.error_code() == grpc::CANCELLED || exchange.Gone()) co_return;
  const std::string last = LastEvent(status);
  co_await exchange.SendPiece(last);
  co_await exchange.End();
}

asio::awaitable<void> Api::Download(Exchange& exchange, const Route& route,
                                    const Message& request) {
  const asio::any_io_executor executor = co_await asio::this_coro::executor;
  const std::string authorization = AuthorizationOf(exchange.head());
  const auto call = Begin(exchange, route.rpc, executor, authorization);
  co_await call->WriteLast(request);
  v1::ExportModelResponse part;
  RpcCall::Got got = co_await call->Read(&part);
  if (call->let_in()) exchange.Admit();
  if (got != RpcCall::Got::kMessage || !part.has_header()) {
    const grpc::Status status = co_await call->Finish();
    Answer refused = Failure(status);
    co_await exchange.Send(std::move(refused));
    co_return;
  }
  Answer head{200, "application/octet-stream", "", {}};
  head.headers.emplace_back("Content-Disposition", AttachmentOf(request));
  head.headers.emplace_back("Cache-Control", "no-store");
  if (auto header = JsonOf(part.header()); header.ok()) {
    head.headers.emplace_back("Litags-Answer", *std::move(header));
  }
  int64_t missing = part.header().size_bytes();
  bool open = co_await exchange.Begin(std::move(head), missing);
  while (open) {
    got = co_await call->Read(&part);
    if (got != RpcCall::Got::kMessage) break;
    missing -= static_cast<int64_t>(part.chunk().size());
    open = co_await exchange.SendPiece(part.chunk());
  }
  const grpc::Status status = co_await call->Finish();
  // A file that is cut short is seen by its length: the connection ends before it.
  if (open && status.ok() && missing == 0) co_await exchange.End();
}

}  // namespace litags::web
