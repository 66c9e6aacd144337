#include "server/web/connection.h"

#include <poll.h>
#include <spdlog/spdlog.h>

#include <array>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/detached.hpp>
#include <boost/asio/redirect_error.hpp>
#include <boost/asio/ssl/stream.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <boost/asio/write.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/core/tcp_stream.hpp>
#include <boost/beast/http/buffer_body.hpp>
#include <boost/beast/http/parser.hpp>
#include <boost/beast/http/read.hpp>
#include <boost/beast/ssl/ssl_stream.hpp>
#include <chrono>
#include <exception>
#include <limits>
#include <optional>
#include <type_traits>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "server/auth/request_id.h"
#include "server/web/failure.h"
#include "server/web/guard.h"

namespace litags::web {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = boost::beast::http;
using beast::error_code;

using PlainStream = beast::tcp_stream;
using TlsStream = beast::ssl_stream<beast::tcp_stream>;
using Parser = http::request_parser<http::buffer_body>;

constexpr uint32_t kMaxHeadBytes = 16 << 10;
constexpr size_t kReadBytes = 64 << 10;
// Clients that read faster are never late.
constexpr double kMinBytesPerSecond = 1 << 20;
// What is read of a body that nobody wants, so that the client sees the answer before the end.
constexpr int64_t kMaxDrained = 8 << 20;
constexpr std::chrono::seconds kClose{2};

std::chrono::milliseconds Ms(double seconds) {
  return std::chrono::milliseconds(static_cast<int64_t>(1000 * seconds));
}

template <typename Stream>
class Connection final : public Exchange {
 public:
  Connection(Stream stream, std::shared_ptr<asio::ssl::context> tls, Caller caller,
             ConnectionEnvironment* environment)
      : tls_(std::move(tls)),
        stream_(std::move(stream)),
        caller_(std::move(caller)),
        environment_(environment) {}

  asio::awaitable<void> Run() {
    bool open = true;
    if constexpr (kTls) {
      SetDeadline(environment_->limits.head_seconds);
      error_code error;
      co_await stream_.async_handshake(asio::ssl::stream_base::server, Into(error));
      open = !error;
    }
    while (open && !environment_->stopping) {
      open = co_await ServeOne();
    }
    co_await Close();
  }

  const Head& head() const override { return head_; }

  asio::awaitable<absl::StatusOr<std::string>> ReadPiece(size_t most) override {
    co_await SendContinue();
    std::string piece(most, '\0');
    size_t size = 0;
    while (size == 0 && !parser_->is_done()) {
      auto& body = parser_->get().body();
      body.data = piece.data();
      body.size = piece.size();
      body.more = true;
      const auto [error, silent] = co_await ReadSome();
      if (silent) {
        must_close_ = true;
        co_return MakeError(absl::StatusCode::kDeadlineExceeded, "UPLOAD_STALLED", "body",
                            "the body stopped coming; send the rest");
      }
      if (error && error != http::error::need_buffer) co_return BodyError(error);
      size = piece.size() - body.size;
    }
    piece.resize(size);
    co_return piece;
  }

  asio::awaitable<absl::StatusOr<std::string>> ReadBody(size_t most) override {
    std::string whole;
    while (true) {
      absl::StatusOr<std::string> piece = co_await ReadPiece(kReadBytes);
      if (!piece.ok()) co_return piece.status();
      if (piece->empty()) co_return whole;
      whole += *piece;
      if (whole.size() > most) {
        co_return MakeError(
            absl::StatusCode::kResourceExhausted, "BODY_TOO_LARGE", "body",
            absl::StrCat("the body has more than ", most, " bytes; send less at a time"));
      }
    }
  }

  asio::awaitable<bool> Send(Answer answer) override {
    AddHeaders(&answer);
    std::string text =
        HeadText(answer, static_cast<int64_t>(answer.body.size()), /*chunked=*/false, KeepsOpen());
    answered_ = true;
    if (head_.method == "HEAD" || answer.code == 204 || answer.code == 304) answer.body.clear();
    const std::array<asio::const_buffer, 2> parts = {asio::buffer(text), asio::buffer(answer.body)};
    const bool sent = co_await WriteAll(parts, text.size() + answer.body.size());
    co_return sent;
  }

  asio::awaitable<bool> Begin(Answer head, std::optional<int64_t> length) override {
    AddHeaders(&head);
    // Without a length HTTP/1.0 clients read to the end of the connection.
    chunked_ = !length && http11_;
    if (!length && !http11_) must_close_ = true;
    const std::string text = HeadText(head, length, chunked_, KeepsOpen());
    answered_ = true;
    begun_ = true;
    const bool sent = co_await WriteAll(asio::buffer(text), text.size());
    co_return sent;
  }

  asio::awaitable<bool> SendPiece(std::string_view piece) override {
    if (piece.empty()) co_return !failed_;
    const std::string size = chunked_ ? absl::StrCat(absl::Hex(piece.size()), "\r\n") : "";
    const std::string_view end = chunked_ ? "\r\n" : "";
    const std::array<asio::const_buffer, 3> parts = {asio::buffer(size), asio::buffer(piece),
                                                     asio::buffer(end)};
    const bool sent = co_await WriteAll(parts, piece.size());
    co_return sent;
  }

  asio::awaitable<bool> End() override {
    begun_ = false;
    if (!chunked_) co_return !failed_;
    static const std::string kLast = "0\r\n\r\n";
    const bool sent = co_await WriteAll(asio::buffer(kLast), kLast.size());
    co_return sent;
  }

  bool Gone() override {
    if (environment_->stopping || failed_) return true;
    pollfd look = {Lowest().socket().native_handle(), POLLRDHUP, 0};
    return poll(&look, 1, 0) > 0 && (look.revents & (POLLRDHUP | POLLHUP | POLLERR)) != 0;
  }

  void Admit() override { environment_->admit(caller_.peer); }

 private:
  static constexpr bool kTls = std::is_same_v<Stream, TlsStream>;

  static auto Into(error_code& error) { return asio::redirect_error(asio::use_awaitable, error); }

  void AddHeaders(Answer* answer) const {
    AddSecurityHeaders(answer);
    if (!head_.request_id.empty()) {
      answer->headers.emplace_back(kRequestIdHeader, head_.request_id);
    }
  }

  beast::tcp_stream& Lowest() { return beast::get_lowest_layer(stream_); }
  void SetDeadline(double seconds) { Lowest().expires_after(Ms(seconds)); }
  bool KeepsOpen() const {
    return !must_close_ && !failed_ && !environment_->stopping && parser_ && parser_->keep_alive();
  }

  // Errors of what the client sent, not of the connection.
  static const boost::system::error_category& HttpErrors() {
    return make_error_code(http::error::bad_target).category();
  }

  // One request; whether another may follow.
  asio::awaitable<bool> ServeOne() {
    parser_.emplace();
    parser_->header_limit(kMaxHeadBytes);
    parser_->body_limit(std::numeric_limits<uint64_t>::max());  // handlers have limits of their own
    must_close_ = answered_ = begun_ = chunked_ = false;
    head_ = Head();
    error_code error;
    SetDeadline(environment_->limits.head_seconds);
    co_await http::async_read_header(stream_, buffer_, *parser_, Into(error));
    if (error) {
      if (error.category() == HttpErrors()) co_await RefuseHead(error);
      co_return false;
    }
    if (!TakeHead()) {
      must_close_ = true;
      Answer refused = Failure(InvalidInput("REQUEST_UNREADABLE", "path",
                                            "the address is no path with a query; encode it as "
                                            "RFC 3986 says"));
      co_await Send(std::move(refused));
      co_return false;
    }
    co_await environment_->handler(*this);
    if (begun_ || !answered_) co_return false;  // cut short: the client is to see that
    if (!KeepsOpen()) co_return false;
    const bool drained = co_await Drain();
    co_return drained;
  }

  bool TakeHead() {
    const auto& message = parser_->get();
    http11_ = message.version() >= 11;
    head_.method = std::string(message.method_string());
    for (const auto& field : message) {
      std::string name(field.name_string());
      absl::AsciiStrToLower(&name);
      std::string& value = head_.headers[name];
      if (!value.empty()) value += name == "cookie" ? "; " : ", ";
      value.append(field.value().data(), field.value().size());
    }
    if (const auto length = parser_->content_length()) {
      head_.content_length = static_cast<int64_t>(*length);
    }
    head_.tls = kTls;
    head_.peer = caller_.text;
    head_.network = caller_.network;
    head_.request_id = RequestIdOf(head_.Header(kRequestIdHeader));
    wants_continue_ = absl::AsciiStrToLower(std::string(head_.Header("expect"))) == "100-continue";
    const std::string_view target(message.target().data(), message.target().size());
    return ParseTarget(target, &head_);
  }

  asio::awaitable<void> RefuseHead(error_code error) {
    if (error == http::error::end_of_stream || error == http::error::partial_message) co_return;
    must_close_ = true;
    head_.request_id = RequestIdOf("");
    const bool large = error == http::error::header_limit;
    Answer refused =
        Failure(InvalidInput(large ? "HEADERS_TOO_LARGE" : "REQUEST_UNREADABLE", "",
                             absl::StrCat("this is no HTTP/1.1 request of ", kMaxHeadBytes,
                                          " bytes of headers at most: ", error.message())),
                large ? 431 : 400);
    co_await Send(std::move(refused));
  }

  // Some of the body, and whether the client was silent for too long. A deadline of the stream
  // would close it, and the client got no answer.
  asio::awaitable<std::pair<error_code, bool>> ReadSome() {
    Lowest().expires_never();
    asio::steady_timer timer(stream_.get_executor(), Ms(environment_->limits.silence_seconds));
    const auto read = std::make_shared<beast::tcp_stream*>(&Lowest());  // null: over, or cancelled
    timer.async_wait([read](error_code error) {
      if (!error && *read) std::exchange(*read, nullptr)->cancel();
    });
    error_code error;
    co_await http::async_read_some(stream_, buffer_, *parser_, Into(error));
    const bool silent = !std::exchange(*read, nullptr) && error;
    co_return std::pair(error, silent);
  }

  absl::Status BodyError(error_code error) {
    must_close_ = true;
    failed_ = error.category() != HttpErrors();
    return InvalidInput("REQUEST_UNREADABLE", "body",
                        absl::StrCat("the body broke off: ", error.message()));
  }

  asio::awaitable<void> SendContinue() {
    if (!std::exchange(wants_continue_, false)) co_return;
    static const std::string kContinue = "HTTP/1.1 100 Continue\r\n\r\n";
    co_await WriteAll(asio::buffer(kContinue), kContinue.size());
  }

  template <typename Buffers>
  asio::awaitable<bool> WriteAll(const Buffers& buffers, size_t size) {
    if (failed_) co_return false;
    SetDeadline(environment_->limits.unread_seconds +
                static_cast<double>(size) / kMinBytesPerSecond);
    error_code error;
    co_await asio::async_write(stream_, buffers, Into(error));
    // Ours, or that of the kernel for what is not acknowledged.
    if (error == beast::error::timeout || error == asio::error::timed_out) {
      spdlog::info("peer={} cut off: it does not read its answer", caller_.text);
    }
    failed_ = failed_ || error;
    co_return !failed_;
  }

  // Reads what is left of the body, so that the next request can be found.
  asio::awaitable<bool> Drain() {
    wants_continue_ = false;
    int64_t drained = 0;
    while (!parser_->is_done() && drained < kMaxDrained) {
      const auto piece = co_await ReadPiece(kReadBytes);
      if (!piece.ok()) co_return false;
      drained += static_cast<int64_t>(piece->size());
    }
    co_return parser_->is_done();
  }

  asio::awaitable<void> Close() {
    error_code ignored;
    if (!failed_) {
      Lowest().expires_after(kClose);
      if constexpr (kTls) co_await stream_.async_shutdown(Into(ignored));
    }
    Lowest().socket().shutdown(asio::ip::tcp::socket::shutdown_send, ignored);
    // A connection that is closed with bytes unread loses the answer on its way.
    if (parser_ && !parser_->is_done() && answered_ && !environment_->stopping) {
      std::string sink(kReadBytes, '\0');
      error_code error;
      Lowest().expires_after(kClose);
      for (int64_t drained = 0; !error && drained < kMaxDrained;) {
        const size_t size = co_await Lowest().async_read_some(asio::buffer(sink), Into(error));
        drained += static_cast<int64_t>(size);
      }
    }
    Lowest().socket().shutdown(asio::ip::tcp::socket::shutdown_both, ignored);
    Lowest().close();
  }

  const std::shared_ptr<asio::ssl::context> tls_;  // outlives the stream
  Stream stream_;
  const Caller caller_;
  ConnectionEnvironment* const environment_;
  beast::flat_buffer buffer_{kReadBytes + kMaxHeadBytes};
  std::optional<Parser> parser_;
  Head head_;
  bool http11_ = true;
  bool wants_continue_ = false;
  bool must_close_ = false;  // after this answer
  bool failed_ = false;      // nothing can be sent any more
  bool answered_ = false;
  bool begun_ = false;  // pieces are to follow
  bool chunked_ = false;
};

template <typename Stream>
void Spawn(Stream stream, std::shared_ptr<asio::ssl::context> tls, Caller caller,
           ConnectionEnvironment* environment) {
  const auto executor = stream.get_executor();
  auto connection = std::make_shared<Connection<Stream>>(std::move(stream), std::move(tls),
                                                         std::move(caller), environment);
  asio::co_spawn(
      executor, [connection] { return connection->Run(); },
      [connection](std::exception_ptr error) {
        try {
          if (error) std::rethrow_exception(error);
        } catch (const std::exception& thrown) {
          spdlog::error("a connection of the page ended: {}", thrown.what());
        }
      });
}

}  // namespace

void ServeConnection(asio::ip::tcp::socket socket, std::shared_ptr<asio::ssl::context> tls,
                     Caller caller, ConnectionEnvironment* environment) {
  beast::tcp_stream stream(std::move(socket));
  if (tls) {
    TlsStream encrypted(std::move(stream), *tls);
    Spawn(std::move(encrypted), std::move(tls), std::move(caller), environment);
  } else {
    Spawn(std::move(stream), nullptr, std::move(caller), environment);
  }
}

}  // namespace litags::web
