#ifndef LITAGS_SERVER_WEB_EXCHANGE_H_
#define LITAGS_SERVER_WEB_EXCHANGE_H_

#include <boost/asio/awaitable.hpp>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

#include "absl/status/statusor.h"
#include "server/web/http.h"

namespace litags::web {

// One request and its answer, for the coroutine that makes the answer. Answers carry the security
// headers. A client that reads or sends too slowly is cut off: then what follows returns false.
class Exchange {
 public:
  virtual ~Exchange() = default;

  virtual const Head& head() const = 0;

  // The next bytes of the body, at most `most`; empty at its end. DEADLINE_EXCEEDED
  // (UPLOAD_STALLED), INVALID_ARGUMENT (REQUEST_UNREADABLE).
  virtual boost::asio::awaitable<absl::StatusOr<std::string>> ReadPiece(size_t most) = 0;
  // All of it. RESOURCE_EXHAUSTED (BODY_TOO_LARGE) beyond `most`.
  virtual boost::asio::awaitable<absl::StatusOr<std::string>> ReadBody(size_t most) = 0;

  // The whole answer at once, ...
  virtual boost::asio::awaitable<bool> Send(Answer answer) = 0;
  // ... or its head, then pieces, then the end. Without `length` pieces may be as many as they are.
  virtual boost::asio::awaitable<bool> Begin(Answer head, std::optional<int64_t> length) = 0;
  virtual boost::asio::awaitable<bool> SendPiece(std::string_view piece) = 0;
  virtual boost::asio::awaitable<bool> End() = 0;

  // The client has closed the connection, or the server is about to.
  virtual bool Gone() = 0;
  // The services have let a call in: the connection may stay.
  virtual void Admit() = 0;
};

using Handler = std::function<boost::asio::awaitable<void>(Exchange&)>;

}  // namespace litags::web

#endif  // LITAGS_SERVER_WEB_EXCHANGE_H_
