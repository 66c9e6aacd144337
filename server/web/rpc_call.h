// The services' calls, waited for by coroutines.
#ifndef LITAGS_SERVER_WEB_RPC_CALL_H_
#define LITAGS_SERVER_WEB_RPC_CALL_H_

#include <google/protobuf/message.h>
#include <grpcpp/generic/generic_stub.h>

#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/awaitable.hpp>
#include <boost/asio/execution/outstanding_work.hpp>
#include <boost/asio/steady_timer.hpp>
#include <functional>
#include <map>
#include <memory>
#include <string>

#include "server/net/shared_room.h"

namespace litags::web {

// One call of any kind: write requests, read answers, finish. Its methods are called by one
// coroutine, on `executor`, which must be a strand. While that waits, the call is cancelled once
// `gone` says that nobody is there for the answer.
//
// An answer takes room in `unread`, as its client's, from when it has come until the next is waited
// for or this is gone: send it meanwhile. The services make no large answers where there is no
// room.
class RpcCall {
 public:
  // `method`: "ReconstructionService/GetJob".
  RpcCall(grpc::GenericStub* stub, std::string_view method,
          const std::multimap<std::string, std::string>& metadata,
          boost::asio::any_io_executor executor, std::function<bool()> gone, SharedRoom* unread);
  ~RpcCall();  // cancels what is not finished
  RpcCall(const RpcCall&) = delete;
  RpcCall& operator=(const RpcCall&) = delete;

  // False: the call has ended; Finish() says why.
  boost::asio::awaitable<bool> Write(const google::protobuf::Message& request);
  // The same of the last request.
  boost::asio::awaitable<bool> WriteLast(const google::protobuf::Message& request);

  enum class Got { kMessage, kEnd, kNothingYet };
  // The next answer. kNothingYet: none came for so long; read again.
  boost::asio::awaitable<Got> Read(google::protobuf::Message* answer, double seconds = 1e9);

  // Whether the services have said that they let the call in; they may do so with the first answer
  // only. A call that gRPC itself refuses never was.
  bool let_in() const;

  // The room that the last answer takes: for callers that keep it longer than the call.
  HeldRoom TakeHeld();

  // The end; after it nothing is written or read. Says the same when asked again.
  boost::asio::awaitable<grpc::Status> Finish();

 private:
  class Reactor;
  std::shared_ptr<Reactor> reactor_;
};

}  // namespace litags::web

#endif  // LITAGS_SERVER_WEB_RPC_CALL_H_
