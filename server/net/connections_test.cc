// Who is cut when many come, by made-up peers.
#include "server/net/connections.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "server/net/peer.h"

namespace litags {
namespace {

using ::testing::ElementsAre;
using Added = Connections::Added;

// One end is a connection's, the other sees that it was cut.
class Socket {
 public:
  Socket() { EXPECT_EQ(socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends_), 0); }
  ~Socket() {
    for (const int end : ends_) close(end);
  }
  Socket(const Socket&) = delete;

  int fd() const { return ends_[0]; }
  // As gRPC does.
  void Close() { close(std::exchange(ends_[0], -1)); }
  bool IsCut() const {
    char byte;
    return recv(ends_[1], &byte, 1, MSG_DONTWAIT) == 0;
  }

 private:
  int ends_[2];
};

// `at`: as Peer::Text().
Added Add(Connections& connections, const Socket& socket, const std::string& at) {
  return connections.Add(socket.fd(), *ParsePeer("for:" + at));
}

// The addresses of so many who have nothing in common.
std::vector<std::string> Unrelated(int count) {
  std::vector<std::string> all;
  for (int i = 0; i < count; ++i) all.push_back(absl::StrCat(2 + i / 200, ".", i % 200, ".0.1:1"));
  return all;
}

class CrowdOfOneNetwork : public ::testing::TestWithParam<bool> {};

TEST_P(CrowdOfOneNetwork, CountsAsOneHoweverManyAddressesItHas) {
  Connections connections({.max_newcomers = 100});
  const Socket honest, crowd;
  Add(connections, honest, "192.0.2.7:1");
  for (int i = 0; i < 300; ++i) {
    const std::string at = GetParam() ? absl::StrCat("[2001:db8:1:", absl::Hex(i), "::1]:1")
                                      : absl::StrCat("198.51.100.", i % 250, ":1");
    EXPECT_EQ(Add(connections, crowd, at), Added::kYes);
  }
  EXPECT_FALSE(honest.IsCut());
  EXPECT_EQ(connections.newcomers(), 100);
}

INSTANTIATE_TEST_SUITE_P(Networks, CrowdOfOneNetwork, ::testing::Bool(),
                         [](const auto& kind) { return kind.param ? "Ipv6" : "Ipv4"; });

TEST(NewcomersTest, OfUnrelatedNetworksTheOldestLoses) {
  Connections connections({.max_newcomers = 256});
  const Socket oldest, honest, crowd;
  Add(connections, oldest, "203.0.113.1:1");
  const auto others = Unrelated(300);
  for (int i = 0; i < 255; ++i) Add(connections, crowd, others[static_cast<size_t>(i)]);
  EXPECT_FALSE(oldest.IsCut());
  EXPECT_EQ(Add(connections, honest, "1.2.3.4:1"), Added::kYes);
  EXPECT_TRUE(oldest.IsCut());
  for (int i = 255; i < 300; ++i) Add(connections, crowd, others[static_cast<size_t>(i)]);
  EXPECT_FALSE(honest.IsCut());
  EXPECT_EQ(connections.newcomers(), 256);
}

TEST(NewcomersTest, OfAWiderNetworkTheAddressWithMostLoses) {
  Connections connections({.max_newcomers = 4});
  const Socket neighbour, twice, again, other, next;
  Add(connections, neighbour, "192.0.2.1:1");
  Add(connections, twice, "192.0.2.2:1");
  Add(connections, again, "192.0.2.2:2");
  Add(connections, other, "203.0.113.1:1");
  Add(connections, next, "203.0.113.2:1");
  EXPECT_TRUE(twice.IsCut());
  EXPECT_FALSE(neighbour.IsCut() || again.IsCut() || other.IsCut() || next.IsCut());
}

class Loopback : public ::testing::TestWithParam<const char*> {};

TEST_P(Loopback, MakesRoomForItselfAlone) {
  Connections connections({.max_newcomers = 2});
  const Socket first, second, third, crowd;
  Add(connections, first, absl::StrCat(GetParam(), ":1"));
  for (const std::string& at : Unrelated(300)) EXPECT_EQ(Add(connections, crowd, at), Added::kYes);
  EXPECT_FALSE(first.IsCut());

  Connections full({.max_newcomers = 2});
  Add(full, second, absl::StrCat(GetParam(), ":2"));
  Add(full, third, absl::StrCat(GetParam(), ":3"));
  EXPECT_EQ(Add(full, crowd, "192.0.2.7:1"), Added::kNoRoom);
  EXPECT_EQ(Add(full, crowd, absl::StrCat(GetParam(), ":4")), Added::kYes);
  EXPECT_TRUE(second.IsCut());
  EXPECT_FALSE(third.IsCut());
}

INSTANTIATE_TEST_SUITE_P(Networks, Loopback, ::testing::Values("127.0.0.1", "127.1.2.3", "[::1]"));

class ConnectionsOfAClient : public ::testing::Test {
 protected:
  static constexpr int kCount = 8;

  ConnectionsOfAClient() {
    for (int i = 0; i < kCount; ++i) Add(connections_, sockets_[i], At(i));
  }
  static std::string At(int i) { return absl::StrCat("192.0.", i, ".7:1"); }
  // The first call on a connection is let in, and stays open.
  void Call(int i, const std::string& client) {
    EXPECT_TRUE(connections_.OpenCall(Number(i), client));
    connections_.WholeCall(Number(i), "for:" + At(i), /*upload=*/false);
    connections_.Admit("for:" + At(i), client);
  }
  void End(int i) { connections_.EndCall(Number(i), /*upload=*/false); }
  static uint64_t Number(int i) { return static_cast<uint64_t>(i) + 1; }
  std::vector<int> Cut() const {
    std::vector<int> cut;
    for (int i = 0; i < kCount; ++i) {
      if (sockets_[i].IsCut()) cut.push_back(i);
    }
    return cut;
  }

  Socket sockets_[kCount];
  Connections connections_{{.max_connections = kCount}};
};

TEST_F(ConnectionsOfAClient, AreAQuarterOfAllAndTheOldestWithoutCallsGoes) {
  for (const int hers : {0, 1}) Call(hers, "alice");
  Call(2, "bob");
  End(1);
  End(2);
  EXPECT_THAT(Cut(), ElementsAre());
  Call(3, "alice");
  EXPECT_THAT(Cut(), ElementsAre(1));
  Call(4, "alice");
  EXPECT_THAT(Cut(), ElementsAre(0, 1)) << "all have calls";
  sockets_[3].Close();
  connections_.Look();
  Call(5, "alice");
  EXPECT_THAT(Cut(), ElementsAre(0, 1, 3)) << "what gRPC closed counts no more";
}

TEST_F(ConnectionsOfAClient, AreNotCountedWithoutNames) {
  for (int i = 0; i < kCount; ++i) Call(i, "");
  EXPECT_THAT(Cut(), ElementsAre());
}

}  // namespace
}  // namespace litags
