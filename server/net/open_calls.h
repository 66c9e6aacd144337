#ifndef LITAGS_SERVER_NET_OPEN_CALLS_H_
#define LITAGS_SERVER_NET_OPEN_CALLS_H_

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <string>

namespace litags {

// What calls may cost until their requests have come whole.
struct CallCounts {
  // Calls that are open on a connection of which none was let in: gRPC takes some 10 KiB for each.
  int of_stranger = 16;
  int of_connection = 1000;
  int of_client = 4096;  // on all its connections
  // Bytes of requests that have not come whole, and of uploads that nobody has read yet; one client
  // may have half.
  int64_t unfinished_bytes = int64_t{128} << 20;
  double unfinished_seconds = 60;  // for one request
};

// The calls that connections have open. A connection is named by a number that gRPC's side gives
// it, and its socket is known once a call has come whole. Not thread-safe.
class OpenCalls {
 public:
  using Clock = std::chrono::steady_clock;

  struct OfConnection {
    std::optional<std::string> client;  // the first that was known
    int open = 0;
    int unfinished = 0;                  // of them, those whose request has not come whole
    int uploads = 0;                     // of them, those whose messages go on coming
    Clock::time_point began;             // with its first call
    Clock::time_point unfinished_since;  // there was at least one all the time
    int socket = -1;                     // -1: not known yet
    int64_t bytes_before = 0;            // received when all requests had come whole
    int64_t bytes_read = 0;              // of uploads since then
    // What gRPC may hold for it.
    int64_t HeldBytes() const;
  };

  explicit OpenCalls(CallCounts counts) : counts_(counts) {}

  // The headers of a call came. False: it may not go on, and counts no more. `client`: who sent
  // it, nullopt if nobody knows.
  bool Open(uint64_t connection, const std::optional<std::string>& client, Clock::time_point now);
  // Its request came whole; of an upload: its messages begin to come.
  void Whole(uint64_t connection, bool upload);
  void Read(uint64_t connection, int64_t bytes);
  void End(uint64_t connection, bool upload);

  // Null if it has not opened any.
  const OfConnection* Find(uint64_t connection) const;
  void SetSocket(uint64_t connection, int socket);
  // The connection is gone.
  void Forget(uint64_t connection);
  // Forgets connections that were there before `then` and whose socket was never known.
  void ForgetUnknown(Clock::time_point then);

 private:
  using All = std::map<uint64_t, OfConnection>;

  void AddOpen(OfConnection& calls, int count);
  bool RoomFor(const OfConnection& calls) const;
  All::iterator Erase(All::iterator calls);

  const CallCounts counts_;
  All all_;
  std::map<std::string, int> of_clients_;
};

// What a TCP socket has received so far.
int64_t BytesReceived(int socket);

}  // namespace litags

#endif  // LITAGS_SERVER_NET_OPEN_CALLS_H_
