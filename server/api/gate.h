// The door that every call goes through: who calls, which jobs are theirs, how much at a time.
#ifndef LITAGS_SERVER_API_GATE_H_
#define LITAGS_SERVER_API_GATE_H_

#include <grpcpp/server_context.h>
#include <grpcpp/support/status.h>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "google/protobuf/message.h"
#include "server/api/token_watch.h"
#include "server/auth/authenticator.h"
#include "server/jobs/jobs.h"
#include "server/metrics/metrics.h"
#include "server/net/connections.h"
#include "server/net/shared_room.h"

namespace litags {

// What one client may have; 0: no limit.
struct ClientLimits {
  int64_t max_jobs = 1000;                 // at one time, in any state
  int64_t max_bytes = int64_t{200} << 30;  // of all its jobs, their results included
  int max_streams = 1000;                  // uploads, watches, paths and exports at one time
  double pictures_per_second = 100;        // of pictures, paths, exports and lists of cameras
  double picture_burst = 200;              // that many at once after a pause
  // Of each job, but for administrators who say who they are. Ten times what the defaults of a job
  // ask for, about, and a day; priorities are of use among clients that cannot raise their own.
  JobCaps caps = {.max_iterations = 100'000,
                  .max_gaussians = 2'000'000,
                  .max_run_seconds = 24 * 3600,
                  .max_priority = 0};
};

// What answers may cost that clients have not read yet.
struct AnswerLimits {
  double max_unread_seconds = 60;  // a client that reads nothing for so long is cut off
  // Answers in memory: pictures, lists, pieces of models; one client: half of it.
  int64_t max_unread_bytes = int64_t{512} << 20;
  // Exported models on disk, each until it was read; one client: half of it.
  int64_t max_export_bytes = int64_t{4} << 30;
};

// What requests may cost, as messages in memory: gRPC keeps them until the end of their calls.
// Bytes on the wire may become twenty times as many.
struct RequestLimits {
  int64_t max_bytes = int64_t{4} << 20;  // one; a path through 10,000 poses has some 2.5 MB
  // Of all open calls, with what these keep of their requests; one client: half of it.
  int64_t max_kept_bytes = int64_t{128} << 20;
};

// What a call does, for the limits above.
enum class CallKind {
  kRead,           // answers from the job store
  kChange,         // changes a job
  kStream,         // an upload or a watch: counted while it is open
  kPicture,        // one picture or list of cameras: counted per second
  kPictureStream,  // both: a path or an export
};

struct CallName {
  const char* method;  // "GetJob"
  CallKind kind;
};

class Gate;

// One call that was let in, until its end. Held by whatever works on it.
class Call {
 public:
  ~Call();
  Call(const Call&) = delete;
  Call& operator=(const Call&) = delete;

  // The jobs of the client; an administrator's: all.
  Jobs* jobs() const { return jobs_.get(); }
  const Principal& client() const { return client_; }
  const ClientLimits& limits() const;
  Metrics& metrics() const;
  // How long a call with one answer may wait for its turn, and what it gets then: DEADLINE_EXCEEDED
  // (WAITED_TOO_LONG).
  double SecondsToWait() const;
  absl::Status WaitedTooLong() const;

  // OK while the client would be let in again. UNAUTHENTICATED (TOKEN_INVALID) once its token was
  // taken back. For streams, between two steps; quick.
  absl::Status CheckToken();
  // `look` is called when tokens have changed, until the ticket ends: for steps that wait long.
  TokenWatch::Ticket WatchToken(std::function<void()> look);

  // OK if there is room for another answer. RESOURCE_EXHAUSTED (RENDER_QUEUE_FULL).
  absl::Status CheckRoom() const;
  // The call keeps so many bytes more until it is gone. RESOURCE_EXHAUSTED (SERVER_BUSY).
  absl::Status Keep(int64_t bytes);
  // So many bytes of an upload were read, and nothing holds them any more.
  void CountRead(int64_t bytes);
  // The answer that waits for the client to read it has so many bytes; counts until the next one,
  // or until the call is gone.
  void Hold(int64_t bytes);
  // How long the client may take to read it.
  double SecondsToRead() const;

  // The answer: also counted and logged, with the ids of call and client. Call once.
  grpc::Status End(const absl::Status& status);

 private:
  friend class Gate;
  // What the client showed; texts that outlive the call's headers.
  struct Shown {
    std::optional<std::string> authorization, certificate_name;
  };
  Call(Gate* gate, CallName name, std::string request_id, std::string peer, Principal client);
  void LeaveStream();

  Gate* const gate_;
  const CallName name_;
  const std::string request_id_;
  const std::string peer_;  // for the log
  const Principal client_;
  const std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
  std::shared_ptr<Jobs> jobs_;
  Shown shown_;                          // by streams
  std::atomic<int64_t> generation_ = 0;  // of the tokens that know the client
  uint64_t connection_ = 0;
  bool holds_stream_ = false;
  int64_t held_bytes_ = 0, kept_bytes_ = 0;
};

// Thread-safe; its methods do not block.
class Gate {
 public:
  // All must outlive this and every Call.
  Gate(Jobs* jobs, Authenticator* authenticator, Metrics* metrics, Connections* connections,
       ClientLimits limits, RequestLimits requests, AnswerLimits answers, double max_wait_seconds)
      : jobs_(jobs),
        authenticator_(authenticator),
        metrics_(metrics),
        connections_(connections),
        limits_(limits),
        requests_(requests),
        answers_(answers),
        max_wait_seconds_(max_wait_seconds),
        kept_(requests.max_kept_bytes),
        unread_(answers.max_unread_bytes),
        token_watch_(authenticator) {}

  // Lets a call in. The answer carries the header "x-request-id", see RequestIdOf(). Its
  // connection may stay. `request`: null if it comes in parts.
  //
  // UNAUTHENTICATED, see Authenticator; INVALID_ARGUMENT (TOO_MANY_IN_CALL); RESOURCE_EXHAUSTED
  // (TOO_MANY_STREAMS, PICTURE_RATE_EXCEEDED, SERVER_BUSY).
  absl::StatusOr<std::shared_ptr<Call>> Enter(grpc::CallbackServerContext* context, CallName name,
                                              const google::protobuf::Message* request);

  // Bytes of answers that clients have not read yet, by client.
  SharedRoom* unread() { return &unread_; }

  // What a call gets that Enter() did not let in: counted and logged, as Call::End() does. Empties
  // the request, which gRPC keeps until the client has heard.
  grpc::Status Refuse(const grpc::CallbackServerContext& context, CallName name,
                      const google::protobuf::Message* request, const absl::Status& status);

 private:
  friend class Call;

  // What a client uses now.
  struct Use {
    int streams = 0;
    double pictures = 0;  // that it may ask for at once
    std::chrono::steady_clock::time_point counted;
  };

  static Call::Shown ShownBy(const grpc::CallbackServerContext& context);
  absl::StatusOr<Principal> Identify(const Call::Shown& shown) const;
  // As which the caller sees and changes jobs.
  ClientView ViewOf(const Principal& client) const;
  absl::Status Keep(Call* call, const google::protobuf::Message& request) const;
  absl::Status Count(Call* call);
  absl::Status CountPicture(Use& use) const;
  void Leave(const Call& call);

  Jobs* const jobs_;
  Authenticator* const authenticator_;
  Metrics* const metrics_;
  Connections* const connections_;
  const ClientLimits limits_;
  const RequestLimits requests_;
  const AnswerLimits answers_;
  const double max_wait_seconds_;
  std::mutex mutex_;
  std::map<std::string, Use> uses_;  // by client; those not in use are dropped now and then
  SharedRoom kept_, unread_;
  TokenWatch token_watch_;
};

}  // namespace litags

#endif  // LITAGS_SERVER_API_GATE_H_
