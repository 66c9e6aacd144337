// One file as the body of a request.
#include <boost/asio/this_coro.hpp>
#include <string_view>

#include "absl/strings/escaping.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "litags/v1/reconstruction_service.pb.h"
#include "server/web/api.h"
#include "server/web/failure.h"
#include "server/web/guard.h"
#include "server/web/transcode.h"

namespace litags::web {
namespace {

namespace asio = boost::asio;

constexpr size_t kPieceBytes = 256 << 10;

absl::string_view Absl(std::string_view text) { return {text.data(), text.size()}; }

absl::Status RangeInvalid() {
  return InvalidInput(
      "CONTENT_RANGE_INVALID", "Content-Range",
      "Content-Range is not \"bytes FIRST-LAST/SIZE\" for as many bytes as the body has, nor "
      "\"bytes */SIZE\" for none; leave it out to send the whole file");
}

// Which bytes of the file the body is.
struct Range {
  int64_t first = 0, end = 0, size = 0;
};

// Of the headers Content-Range ("bytes 0-99/1000"; "bytes */1000": the server has them all) and
// Content-Length.
absl::StatusOr<Range> RangeOf(const Head& head) {
  if (!head.content_length) {
    return InvalidInput("LENGTH_MISSING", "Content-Length",
                        "Content-Length is missing; send the file's size with the request");
  }
  const int64_t length = *head.content_length;
  std::string_view text = head.Header("content-range");
  if (text.empty()) return Range{0, length, length};
  const auto number = [](std::string_view digits, int64_t* value) {
    return absl::SimpleAtoi(Absl(digits), value) && *value >= 0;
  };
  constexpr std::string_view kUnit = "bytes ", kNoBytes = "bytes */";
  if (text.starts_with(kNoBytes)) {
    int64_t size = 0;
    if (length != 0 || !number(text.substr(kNoBytes.size()), &size)) return RangeInvalid();
    return Range{size, size, size};
  }
  const size_t dash = text.find('-'), slash = text.find('/');
  if (!text.starts_with(kUnit) || dash == text.npos || slash == text.npos || dash > slash) {
    return RangeInvalid();
  }
  Range range;
  int64_t last = 0;
  if (!number(text.substr(kUnit.size(), dash - kUnit.size()), &range.first) ||
      !number(text.substr(dash + 1, slash - dash - 1), &last) ||
      !number(text.substr(slash + 1), &range.size) || last >= range.size || last < range.first ||
      last - range.first + 1 != length) {
    return RangeInvalid();
  }
  range.end = last + 1;
  return range;
}

// SHA-256 of the whole file, from "Repr-Digest: sha-256=:BASE64:" (RFC 9530).
std::string DigestOf(const Head& head) {
  constexpr std::string_view kStart = "sha-256=:";
  std::string_view text = head.Header("repr-digest");
  const size_t begin = text.find(kStart);
  if (begin == std::string_view::npos) return "";
  text.remove_prefix(begin + kStart.size());
  std::string digest;
  const bool decoded = absl::Base64Unescape(Absl(text.substr(0, text.find(':'))), &digest);
  return decoded ? digest : "";
}

absl::StatusOr<v1::FileHeader> FileOf(const Match& match, const Head& head, const Range& range) {
  // All else of it is said by headers.
  for (const auto& [name, value] : head.query) {
    if (name != "role") return FieldInvalid(name, "an upload has no such parameter");
  }
  v1::DeleteFileRequest names;  // as its path has them
  LITAGS_RETURN_IF_ERROR(FillFields(match.fields, &names));
  v1::FileHeader file;
  if (!FillFields(head.query, &file).ok()) {
    return FieldInvalid("role", "it is not one FileRole, as FILE_ROLE_PHOTO");
  }
  file.set_file_name(names.file_name());
  file.set_size_bytes(range.size);
  file.set_offset(range.first);
  file.set_sha256(DigestOf(head));
  return file;
}

// Sends the body, `missing` bytes, as chunks of the call; then its end, if this ends the file. Why
// the body could not be read, else OK, whatever became of the call: that says its own end.
asio::awaitable<absl::Status> SendBody(Exchange& exchange, RpcCall& call, int64_t missing,
                                       bool ends_file) {
  v1::UploadImagesRequest message;
  bool open = true;
  while (open && missing > 0) {
    absl::StatusOr<std::string> piece = co_await exchange.ReadPiece(kPieceBytes);
    if (!piece.ok()) co_return piece.status();
    if (piece->empty()) {
      co_return InvalidInput("REQUEST_UNREADABLE", "body", "the body ended early; send the rest");
    }
    missing -= static_cast<int64_t>(piece->size());
    message.set_chunk(*std::move(piece));
    const bool last = missing == 0 && !ends_file;
    if (last) {
      open = co_await call.WriteLast(message);
    } else {
      open = co_await call.Write(message);
    }
  }
  message.mutable_end()->set_files(1);
  if (open && ends_file) co_await call.WriteLast(message);
  co_return absl::OkStatus();
}

}  // namespace

asio::awaitable<void> Api::Upload(Exchange& exchange, const Match& match) {
  const Head& head = exchange.head();
  const absl::StatusOr<Range> range = RangeOf(head);
  const absl::StatusOr<v1::FileHeader> file =
      range.ok() ? FileOf(match, head, *range) : absl::StatusOr<v1::FileHeader>(range.status());
  Answer answer;
  if (!file.ok()) {
    answer = Failure(file.status(), head.content_length ? 0 : 411);
    co_await exchange.Send(std::move(answer));
    co_return;
  }
  // Whether the caller may, before a stranger's bytes are taken.
  v1::GetJobRequest look;
  look.set_name(match.fields.front().second);
  v1::Job found;
  const std::string authorization = AuthorizationOf(head);
  const grpc::Status may =
      co_await Unary(exchange, "ReconstructionService/GetJob", authorization, look, &found);
  if (may.ok()) {
    answer = co_await Forward(exchange, *file, look.name(), range->end);
  } else {
    answer = Failure(may);
  }
  co_await exchange.Send(std::move(answer));
}

asio::awaitable<Answer> Api::Forward(Exchange& exchange, const v1::FileHeader& file,
                                     const std::string& job, int64_t end) {
  const asio::any_io_executor executor = co_await asio::this_coro::executor;
  const std::string authorization = AuthorizationOf(exchange.head());
  const auto call = Begin(exchange, "ReconstructionService/UploadImages", executor, authorization);
  v1::UploadImagesRequest message;
  message.set_name(job);
  bool open = co_await call->Write(message);
  *message.mutable_file() = file;
  if (open) open = co_await call->Write(message);
  const bool ends_file = end == file.size_bytes();
  if (open) {
    const absl::Status sent = co_await SendBody(exchange, *call, end - file.offset(), ends_file);
    // The call is given up, and what came of the file is kept.
    if (!sent.ok()) co_return Failure(sent);
  }
  v1::UploadImagesResponse response;
  co_await call->Read(&response);
  const grpc::Status status = co_await call->Finish();
  if (!ends_file && ReasonOf(status) == "FILE_TRUNCATED") {
    co_return Answer{202, "application/json", absl::StrCat("{\"received\":\"", end, "\"}"), {}};
  }
  if (!status.ok()) co_return Failure(status);
  absl::StatusOr<std::string> json = JsonOf(response);
  if (!json.ok()) co_return Failure(json.status());
  co_return Answer{200, "application/json", *std::move(json), {}};
}

}  // namespace litags::web
