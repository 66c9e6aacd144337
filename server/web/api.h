// The routes of /v1: HTTP on one side, the services' calls on the other.
#ifndef LITAGS_SERVER_WEB_API_H_
#define LITAGS_SERVER_WEB_API_H_

#include <grpcpp/channel.h>
#include <grpcpp/generic/generic_stub.h>

#include <memory>
#include <string>
#include <vector>

#include "client/report/report.h"
#include "litags/v1/reconstruction_service.pb.h"
#include "server/net/shared_room.h"
#include "server/web/exchange.h"
#include "server/web/routes.h"
#include "server/web/rpc_call.h"

namespace litags::web {

// Thread-safe.
class Api {
 public:
  // `local_only`: nobody is asked who they are, so that requests must name this machine itself.
  // `unread`, which must outlive this: of RpcCall.
  Api(std::shared_ptr<grpc::Channel> channel, SharedRoom* unread, bool local_only)
      : stub_(std::move(channel)), unread_(unread), local_only_(local_only) {}

  // Answers a request whose path begins with "/v1/".
  boost::asio::awaitable<void> Serve(Exchange& exchange);

 private:
  static constexpr char kInfoRpc[] = "ReconstructionService/GetServerInfo";
  using Message = google::protobuf::Message;
  template <typename T>
  using Awaitable = boost::asio::awaitable<T>;

  Awaitable<void> Dispatch(Exchange& exchange);
  Awaitable<void> Session(Exchange& exchange);
  Awaitable<void> Call(Exchange& exchange, const Match& match);
  Awaitable<void> Whole(Exchange& exchange, const Route& route, const Message& request);
  Awaitable<void> Events(Exchange& exchange, const Route& route, const Message& request);
  Awaitable<void> Download(Exchange& exchange, const Route& route, const Message& request);
  Awaitable<void> Report(Exchange& exchange, const Route& route, const Message& request);
  Awaitable<grpc::Status> Gather(Exchange& exchange, const Route& route, const Message& request,
                                 report::ReportData* data, std::vector<HeldRoom>* held);
  Awaitable<grpc::Status> ReadCourse(Exchange& exchange, const v1::Job& job,
                                     report::Course* course);
  Awaitable<grpc::Status> ReadScene(Exchange& exchange, report::ReportData* data,
                                    std::vector<HeldRoom>* held);
  // Content-Range sends a part of a file: 202 says that more is missing.
  Awaitable<void> Upload(Exchange& exchange, const Match& match);
  Awaitable<Answer> Forward(Exchange& exchange, const v1::FileHeader& file, const std::string& job,
                            int64_t end);

  std::unique_ptr<RpcCall> Begin(Exchange& exchange, std::string_view rpc,
                                 boost::asio::any_io_executor executor,
                                 const std::string& authorization);
  // A call with one answer. `held`: gets the room that it takes; null: the answer is small.
  Awaitable<grpc::Status> Unary(Exchange& exchange, std::string_view rpc,
                                const std::string& authorization, const Message& request,
                                Message* answer, HeldRoom* held = nullptr);

  grpc::GenericStub stub_;
  SharedRoom* const unread_;
  const bool local_only_;
};

}  // namespace litags::web

#endif  // LITAGS_SERVER_WEB_API_H_
