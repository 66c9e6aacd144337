#ifndef LITAGS_SERVER_NET_CONNECTIONS_H_
#define LITAGS_SERVER_NET_CONNECTIONS_H_

#include <sys/types.h>

#include <chrono>
#include <cstdint>
#include <list>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>

#include "server/net/open_calls.h"
#include "server/net/peer.h"

namespace litags {

// Newcomers are connections that no call was let in from: strangers, and clients for a moment.
struct ConnectionCounts {
  int max_connections = 4096;  // one network may have half of them, one client a quarter
  int max_newcomers = 256;     // so many handshakes and first calls at one time
  // A first call takes milliseconds, on a bad line a few seconds.
  double newcomer_seconds = 20;
  // gRPC takes 64 KiB of a stream until it is let in, but the whole request of a call with one
  // answer; the largest in use, a QueryUpload of 1,000 files, has some 300 KiB.
  int64_t newcomer_bytes = 512 << 10;
  // Shared evenly when there are many; 12 KiB are enough for a handshake and a small call.
  int64_t all_newcomers_bytes = 3 << 20;
  // While strangers open more calls a second than this, gRPC may hold far more for a byte: some 10
  // KiB for 15. Those who sent most go, of the network that sent most, until the rest is within
  // this.
  int crowd_calls = 500;
  int64_t crowd_bytes = 128 << 10;
  CallCounts calls = {};
};

// The open connections of gRPC, which says nothing of them. Thread-safe.
class Connections {
 public:
  using Clock = std::chrono::steady_clock;

  explicit Connections(ConnectionCounts counts) : counts_(counts), calls_(counts.calls) {}
  ~Connections();

  enum class Added {
    kYes,            // `fd` may be handed to gRPC
    kNoRoom,         // and the connection is to be closed
    kNoDescriptors,  // the same, for want of descriptors
  };
  // A connection that came. Makes room among the newcomers: the network with most of them loses its
  // oldest. Those of this machine make room for each other alone.
  Added Add(int fd, const Peer& peer);

  // A call of `client` was let in from `grpc_peer`, as gRPC names it: the connection may stay.
  // Makes room among those of the client, unless it has no name: the oldest without calls goes, if
  // there is none the oldest.
  void Admit(std::string_view grpc_peer, const std::string& client = "");
  void Admit(const Peer& peer, const std::string& client = "");

  // Of the calls on `connection`, a number that stays as long as it: see OpenCalls.
  bool OpenCall(uint64_t connection, const std::optional<std::string>& client);
  void WholeCall(uint64_t connection, std::string_view grpc_peer, bool upload);
  void ReadOfCall(uint64_t connection, int64_t bytes);
  void EndCall(uint64_t connection, bool upload);

  // Cuts newcomers whose time or bytes are used up, and others that owe the rest of their requests
  // for too long or of too many; forgets connections that gRPC has closed.
  // Returns how soon to look again.
  std::chrono::milliseconds Look(Clock::time_point now = Clock::now());

  // Cuts one newcomer, if there is any, since descriptors are short.
  void MakeRoom();

  // Cuts all of them.
  void CutAll();

  int size() const;
  int newcomers() const;

 private:
  enum class State { kNewcomer, kKnown, kCut };
  struct Connection {
    Peer peer;
    std::string network, wider_network;
    int fd;       // gRPC's, which may have closed it
    int own;      // the same socket, so that its number stays: to look at it and to cut it
    ino_t inode;  // of the socket
    Clock::time_point since;
    State state = State::kNewcomer;
    std::optional<uint64_t> number = {};  // once a call of it came whole
    std::string client = {};              // that was let in first
  };
  using List = std::list<Connection>;
  struct OfNetwork {
    int all = 0, newcomers = 0;
  };
  // What connections of one client or network have sent.
  struct Sent {
    int64_t bytes = 0;
    std::multimap<int64_t, Connection*> connections;  // by their bytes
    void Add(int64_t bytes, Connection* connection);
  };
  using SentBy = std::map<std::string, Sent>;

  bool RoomFor(const Peer& peer, const std::string& network);
  bool CutOldest(const std::string& network, std::string_view why);
  // The oldest newcomer of where most come from.
  bool CutNewcomer(bool of_loopback_too, std::string_view why);
  void MakeRoomOf(const std::string& client);
  bool HasCalls(const Connection& connection) const;
  void Cut(Connection& connection, std::string_view why);
  void SetState(Connection& connection, State state);
  Connection* Find(std::string_view grpc_peer);
  Connection* Find(const Peer& peer);
  void CheckNewcomer(Connection& connection, Clock::time_point now);
  void CheckUnfinished(Connection& connection, Clock::time_point now);
  // Whether there are unfinished requests.
  bool CheckUnfinishedBytes();
  void CountStranger(Clock::time_point now);
  // Cuts whoever sent most of those who sent most, until the rest is within the limits.
  void CutMost(SentBy sent, int64_t most_of_all, int64_t most_of_one, const char* why);
  List::iterator Forget(List::iterator connection);

  const ConnectionCounts counts_;
  mutable std::mutex mutex_;
  List all_;  // by age
  std::multimap<Peer, List::iterator> by_peer_;
  std::map<std::string, OfNetwork> networks_;
  std::map<std::string, int> newcomers_of_wider_, of_clients_;
  int newcomers_ = 0, cut_ = 0;
  double strangers_calls_ = 0;  // falls by `crowd_calls` a second
  Clock::time_point strangers_counted_, crowd_cut_;
  OpenCalls calls_;
};

}  // namespace litags

#endif  // LITAGS_SERVER_NET_CONNECTIONS_H_
