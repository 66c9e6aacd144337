#include "server/api/gate.h"

#include <grpcpp/security/auth_context.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <optional>
#include <string_view>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "server/api/call_door.h"
#include "server/api/grpc_order.h"
#include "server/auth/request_id.h"
#include "server/errors/to_grpc.h"
#include "server/net/line_rate.h"
#include "server/net/peer.h"

namespace litags {
namespace {

using SteadyClock = std::chrono::steady_clock;

// Clients whose use is remembered before those that do nothing are dropped.
constexpr size_t kMaxRemembered = 1000;
// An answer is there as a message, and as the bytes that gRPC makes of it.
constexpr int kCopies = 2;
// Kept for a call without being counted, so that small calls are let in when the room is used up:
// gRPC itself takes as much for each.
constexpr int64_t kUncountedBytes = 8 << 10;
// Clients that read faster are never late.
constexpr double kMinBytesPerSecond = 1 << 20;

std::optional<std::string_view> Header(const grpc::CallbackServerContext& context,
                                       const char* name) {
  const auto& headers = context.client_metadata();
  const auto found = headers.find(name);
  if (found == headers.end()) return std::nullopt;
  return std::string_view(found->second.data(), found->second.size());
}

bool IsStream(CallKind kind) {
  return kind == CallKind::kStream || kind == CallKind::kPictureStream;
}

bool IsPicture(CallKind kind) {
  return kind == CallKind::kPicture || kind == CallKind::kPictureStream;
}

// Who calls, of calls by HTTP too. Only what calls in process may say whom it calls for.
std::optional<Peer> CallerOf(const grpc::CallbackServerContext& context) {
  const auto peer = ParsePeer(context.peer());
  if (peer || ConnectionNumber(context) != 0) return peer;
  const auto named = Header(context, kPeerHeader);
  return named ? ParsePeer(absl::StrCat("for:", std::string(*named))) : std::nullopt;
}

// How the log names the other end.
std::string PeerText(const grpc::CallbackServerContext& context) {
  const auto peer = CallerOf(context);
  return peer ? peer->Text() : "-";
}

std::string NetworkText(const grpc::CallbackServerContext& context) {
  const auto peer = CallerOf(context);
  return peer ? peer->Network() : "-";
}

double Seconds(SteadyClock::duration d) { return std::chrono::duration<double>(d).count(); }

}  // namespace

Call::Call(Gate* gate, CallName name, std::string request_id, std::string peer, Principal client)
    : gate_(gate),
      name_(name),
      request_id_(std::move(request_id)),
      peer_(std::move(peer)),
      client_(std::move(client)) {}

Call::~Call() {
  LeaveStream();
  Hold(0);
  if (kept_bytes_ > 0) gate_->kept_.Add(client_.name, -kept_bytes_);
}

void Call::LeaveStream() {
  if (holds_stream_) gate_->Leave(*this);
  holds_stream_ = false;
}

double Call::SecondsToWait() const { return gate_->max_wait_seconds_; }

absl::Status Call::WaitedTooLong() const {
  return MakeError(absl::StatusCode::kDeadlineExceeded, "WAITED_TOO_LONG", "",
                   absl::StrCat("the call waited more than ", gate_->max_wait_seconds_,
                                " s for its turn; the server is busy: try again later"));
}

absl::Status Call::CheckToken() {
  const int64_t generation = gate_->authenticator_->Generation();
  if (generation == generation_.load()) return absl::OkStatus();
  LITAGS_ASSIGN_OR_RETURN(const Principal now, gate_->Identify(shown_));
  if (now.name != client_.name) {
    return MakeError(absl::StatusCode::kUnauthenticated, "TOKEN_INVALID", "authorization",
                     "the token is another client's now; open the stream anew");
  }
  generation_ = generation;
  return absl::OkStatus();
}

TokenWatch::Ticket Call::WatchToken(std::function<void()> look) {
  return gate_->token_watch_.Add(std::move(look));
}

absl::Status Call::CheckRoom() const {
  if (gate_->unread_.IsFor(client_.name)) return absl::OkStatus();
  return MakeError(absl::StatusCode::kResourceExhausted, "RENDER_QUEUE_FULL", "",
                   "the memory for answers that clients have not read yet is used up; read those "
                   "asked for, and try again in a second");
}

absl::Status Call::Keep(int64_t bytes) {
  if (bytes <= kUncountedBytes) return absl::OkStatus();
  if (!gate_->kept_.IsFor(client_.name)) {
    return MakeError(absl::StatusCode::kResourceExhausted, "SERVER_BUSY", "",
                     "the memory for requests of open calls is used up; wait for some to end, and "
                     "try again in a second");
  }
  gate_->kept_.Add(client_.name, bytes);
  kept_bytes_ += bytes;
  return absl::OkStatus();
}

void Call::CountRead(int64_t bytes) { gate_->connections_->ReadOfCall(connection_, bytes); }

void Call::Hold(int64_t bytes) {
  bytes *= kCopies;
  if (bytes != held_bytes_) gate_->unread_.Add(client_.name, bytes - held_bytes_);
  held_bytes_ = bytes;
}

double Call::SecondsToRead() const {
  const double bytes = static_cast<double>(held_bytes_) / kCopies;
  return gate_->answers_.max_unread_seconds + bytes / kMinBytesPerSecond;
}

grpc::Status Call::End(const absl::Status& status) {
  LeaveStream();  // a client that hears of the end may open the next
  const double seconds = Seconds(SteadyClock::now() - start_);
  const bool quiet = status.ok() && name_.kind != CallKind::kChange;
  const std::string code = absl::StatusCodeToString(status.code());
  std::string ending;
  if (status.ok() ||
      CallerLines().Pass(absl::StrCat(name_.method, "/", code, "/", client_.name), &ending)) {
    spdlog::log(quiet ? spdlog::level::debug : spdlog::level::info,
                "call={} request={} client={} peer={} code={} ms={:.1f} {}{}", name_.method,
                request_id_, client_.name.empty() ? "-" : client_.name, peer_, code, 1000 * seconds,
                std::string(status.message()), ending);
  }
  metrics().AddCall(name_.method, status.code(), IsStream(name_.kind) ? -1 : seconds);
  metrics().AddIfStoreError(status);
  return ToGrpc(status);
}

const ClientLimits& Call::limits() const { return gate_->limits_; }

Metrics& Call::metrics() const { return *gate_->metrics_; }

grpc::Status Gate::Refuse(const grpc::CallbackServerContext& context, CallName name,
                          const google::protobuf::Message* request, const absl::Status& status) {
  if (request) {
    // gRPC made it for this call, and nobody has looked at it. Clear() would keep the memory.
    const std::unique_ptr<google::protobuf::Message> empty(request->New());
    request->GetReflection()->Swap(empty.get(), const_cast<google::protobuf::Message*>(request));
  }
  const std::string code = absl::StatusCodeToString(status.code());
  std::string ending;
  if (CallerLines().Pass(absl::StrCat(name.method, "/", code, "/", NetworkText(context)),
                         &ending)) {
    spdlog::info("call={} peer={} code={} {}{}", name.method, PeerText(context), code,
                 std::string(status.message()), ending);
  }
  metrics_->AddCall(name.method, status.code(), -1);
  return ToGrpc(status);
}

absl::StatusOr<std::shared_ptr<Call>> Gate::Enter(grpc::CallbackServerContext* context,
                                                  CallName name,
                                                  const google::protobuf::Message* request) {
  AfterStart(this);
  std::string request_id = RequestIdOf(Header(*context, kRequestIdHeader).value_or(""));
  context->AddInitialMetadata(kRequestIdHeader, request_id);
  const int64_t generation = authenticator_->Generation();  // before: a change meanwhile is seen
  Call::Shown shown = ShownBy(*context);
  LITAGS_ASSIGN_OR_RETURN(Principal client, Identify(shown));
  connections_->Admit(context->peer(), client.name);
  if (!ParsePeer(context->peer())) context->AddInitialMetadata(kRoomOfHeader, client.name);
  std::shared_ptr<Call> call(
      new Call(this, name, std::move(request_id), PeerText(*context), std::move(client)));
  call->generation_ = generation;
  call->connection_ = ConnectionNumber(*context);
  if (IsStream(name.kind)) call->shown_ = std::move(shown);
  if (request) LITAGS_RETURN_IF_ERROR(Keep(call.get(), *request));
  LITAGS_RETURN_IF_ERROR(Count(call.get()));
  call->jobs_ = jobs_->For(ViewOf(call->client_));
  return call;
}

Call::Shown Gate::ShownBy(const grpc::CallbackServerContext& context) {
  Call::Shown shown;
  if (const auto header = Header(context, "authorization")) shown.authorization = *header;
  if (const auto peer = context.auth_context(); peer && peer->IsPeerAuthenticated()) {
    const auto names = peer->FindPropertyValues("x509_common_name");
    if (!names.empty()) shown.certificate_name.emplace(names[0].data(), names[0].size());
  }
  return shown;
}

absl::StatusOr<Principal> Gate::Identify(const Call::Shown& shown) const {
  return authenticator_->Identify(shown.authorization, shown.certificate_name);
}

ClientView Gate::ViewOf(const Principal& client) const {
  ClientView view{client.name, client.admin, limits_.max_jobs, limits_.max_bytes, limits_.caps};
  if (client.admin && !client.name.empty()) view.caps = JobCaps();
  // Without names there is nobody to be unfair to.
  if (client.name.empty()) view.caps.max_priority = kMaxJobPriority;
  return view;
}

absl::Status Gate::Keep(Call* call, const google::protobuf::Message& request) const {
  const auto bytes = static_cast<int64_t>(request.SpaceUsedLong());
  if (bytes <= requests_.max_bytes) return call->Keep(bytes);
  return InvalidInput("TOO_MANY_IN_CALL", "",
                      absl::StrCat("the request takes ", bytes >> 10,
                                   " KiB of memory, and may take ", requests_.max_bytes >> 10,
                                   "; send less at a time, and no fields that the server's version "
                                   "does not have"));
}

absl::Status Gate::Count(Call* call) {
  const CallKind kind = call->name_.kind;
  if (!IsStream(kind) && !IsPicture(kind)) return absl::OkStatus();
  const auto now = SteadyClock::now();
  std::lock_guard lock(mutex_);
  if (uses_.size() > kMaxRemembered) {
    std::erase_if(uses_, [&](const auto& entry) {
      return entry.second.streams == 0 && Seconds(now - entry.second.counted) > 60;
    });
  }
  const auto [entry, is_new] = uses_.try_emplace(call->client_.name);
  Use& use = entry->second;
  const double refill =
      is_new ? limits_.picture_burst : Seconds(now - use.counted) * limits_.pictures_per_second;
  use.pictures = std::min(limits_.picture_burst, use.pictures + refill);
  use.counted = now;
  if (IsPicture(kind)) LITAGS_RETURN_IF_ERROR(CountPicture(use));
  if (!IsStream(kind)) return absl::OkStatus();
  if (limits_.max_streams > 0 && use.streams >= limits_.max_streams) {
    return MakeError(absl::StatusCode::kResourceExhausted, "TOO_MANY_STREAMS", "",
                     absl::StrCat("this client has ", use.streams,
                                  " uploads, watches, paths and exports open, and may have ",
                                  limits_.max_streams, "; wait for one to end"));
  }
  ++use.streams;
  call->holds_stream_ = true;
  return absl::OkStatus();
}

absl::Status Gate::CountPicture(Use& use) const {
  if (limits_.pictures_per_second <= 0) return absl::OkStatus();
  if (use.pictures >= 1) {
    use.pictures -= 1;
    return absl::OkStatus();
  }
  return MakeError(absl::StatusCode::kResourceExhausted, "PICTURE_RATE_EXCEEDED", "",
                   absl::StrCat("this client asks for more than ", limits_.pictures_per_second,
                                " pictures a second; wait a second, or ask for a path instead"));
}

void Gate::Leave(const Call& call) {
  std::lock_guard lock(mutex_);
  --uses_[call.client_.name].streams;
}

}  // namespace litags
