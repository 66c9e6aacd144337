// Connections over loopback, with this test in gRPC's place.
#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdlib>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/str_cat.h"
#include "engine/core/sandbox.h"
#include "server/net/connections.h"
#include "server/net/descriptors.h"
#include "server/net/line_rate.h"
#include "server/net/listener.h"
#include "server/net/open_calls.h"
#include "server/net/peer.h"
#include "server/testing/eventually.h"

namespace litags {
namespace {

using std::chrono::milliseconds;
using ::testing::HasSubstr;

sockaddr_in AddressOf(const std::string& ip, int port) {
  sockaddr_in address = {};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<uint16_t>(port));
  inet_pton(AF_INET, ip.c_str(), &address.sin_addr);
  return address;
}

bool Connects(int fd, int port) {
  const sockaddr_in to = AddressOf("127.0.0.1", port);
  return connect(fd, reinterpret_cast<const sockaddr*>(&to), sizeof(to)) == 0;
}

// A client's socket; `from`: its address, of loopback.
class Socket {
 public:
  explicit Socket(int port, const std::string& from = "127.0.0.1") {
    fd_ = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    sockaddr_in own = AddressOf(from, 0);
    bind(fd_, reinterpret_cast<sockaddr*>(&own), sizeof(own));
    EXPECT_TRUE(Connects(fd_, port));
    socklen_t size = sizeof(own);
    getsockname(fd_, reinterpret_cast<sockaddr*>(&own), &size);
    name_ = absl::StrCat("ipv4:", from, ":", ntohs(own.sin_port));
  }
  ~Socket() { close(fd_); }
  Socket(const Socket&) = delete;

  const std::string& name() const { return name_; }
  void Send(size_t bytes) {
    const std::string text(bytes, 'x');
    EXPECT_EQ(send(fd_, text.data(), text.size(), MSG_NOSIGNAL), static_cast<ssize_t>(text.size()));
  }
  // Whether the other end closed it within this time.
  bool Closed(milliseconds within) {
    pollfd wait = {fd_, POLLIN, 0};
    return poll(&wait, 1, static_cast<int>(within.count())) == 1;
  }

 private:
  int fd_;
  std::string name_;
};

constexpr milliseconds kSoon{10'000}, kAWhile{300};

class ListenerTest : public ::testing::Test {
 protected:
  ~ListenerTest() override {
    if (listener_) listener_->Stop();
    for (const int fd : taken_) close(fd);
  }

  void Start(const ConnectionCounts& counts) {
    connections_ = std::make_unique<Connections>(counts);
    auto listener = Listener::Open("127.0.0.1:0", 20);
    ASSERT_TRUE(listener.ok()) << listener.status();
    listener_ = *std::move(listener);
    listener_->Start(connections_.get(), [this](int, int fd) {
      std::lock_guard lock(mutex_);
      taken_.push_back(fd);
    });
  }
  int port() const { return listener_->port(); }
  void WaitFor(const std::function<bool()>& condition) { EXPECT_TRUE(Eventually(condition)); }
  // A client whose first call came whole and has ended.
  void Known(const Socket& socket, uint64_t number, const std::string& client) {
    EXPECT_TRUE(connections_->OpenCall(number, client));
    connections_->WholeCall(number, socket.name(), false);
    connections_->Admit(socket.name());
    connections_->EndCall(number, false);
  }
  // As gRPC does with what it has read to its end.
  void CloseTaken() {
    std::lock_guard lock(mutex_);
    for (const int fd : taken_) {
      shutdown(fd, SHUT_RDWR);
      close(fd);
    }
    taken_.clear();
  }

  std::mutex mutex_;
  std::vector<int> taken_;
  std::unique_ptr<Connections> connections_;
  std::unique_ptr<Listener> listener_;
};

TEST_F(ListenerTest, AStrangerHasSecondsAndAClientStays) {
  Start({.newcomer_seconds = 0.5});
  Socket stranger(port()), client(port());
  WaitFor([&] { return connections_->size() == 2; });
  connections_->Admit(client.name());
  EXPECT_EQ(connections_->newcomers(), 1);
  EXPECT_TRUE(stranger.Closed(kSoon));
  EXPECT_FALSE(client.Closed(kAWhile));
}

TEST_F(ListenerTest, AStrangerHasKilobytes) {
  Start({.newcomer_seconds = 60, .newcomer_bytes = 10'000});
  Socket stranger(port()), client(port());
  stranger.Send(9000);
  EXPECT_FALSE(stranger.Closed(kAWhile));
  connections_->Admit(client.name());
  client.Send(20'000);
  stranger.Send(2000);
  EXPECT_TRUE(stranger.Closed(kSoon));
  EXPECT_FALSE(client.Closed(kAWhile));
}

TEST_F(ListenerTest, ManyStrangersHaveFewerBytesEach) {
  Start({.newcomer_seconds = 60, .newcomer_bytes = 10'000, .all_newcomers_bytes = 10'000});
  Socket one(port());
  one.Send(6000);
  EXPECT_FALSE(one.Closed(kAWhile));
  Socket two(port());
  EXPECT_TRUE(one.Closed(kSoon));
}

TEST_F(ListenerTest, TheNetworkWithMostNewcomersLosesItsOldest) {
  Start({.max_connections = 100, .max_newcomers = 4, .newcomer_seconds = 60});
  Socket honest(port(), "127.0.0.9");
  WaitFor([&] { return connections_->size() == 1; });
  std::vector<std::unique_ptr<Socket>> hostile;
  for (int i = 0; i < 8; ++i) {
    hostile.push_back(std::make_unique<Socket>(port(), "127.0.0.2"));
    WaitFor([&] { return connections_->size() == i + 2; });
  }
  for (int i = 0; i < 5; ++i) EXPECT_TRUE(hostile[static_cast<size_t>(i)]->Closed(kSoon)) << i;
  EXPECT_FALSE(honest.Closed(kAWhile));
  EXPECT_FALSE(hostile[7]->Closed(milliseconds(0)));
  EXPECT_EQ(connections_->newcomers(), 4);
}

TEST_F(ListenerTest, OneNetworkHasHalfOfAllAndOthersStillCome) {
  Start({.max_connections = 4, .max_newcomers = 4, .newcomer_seconds = 60});
  Socket one(port()), two(port());
  WaitFor([&] { return connections_->size() == 2; });
  connections_->Admit(one.name());
  connections_->Admit(two.name());
  Socket three(port());
  EXPECT_TRUE(three.Closed(kSoon));
  Socket other(port(), "127.0.0.9");
  EXPECT_FALSE(other.Closed(kAWhile));
  EXPECT_EQ(connections_->size(), 3);
}

TEST_F(ListenerTest, WhileGrpcIsBehindOthersWaitAndAreNotRefused) {
  Start({.max_connections = 16, .max_newcomers = 1, .newcomer_seconds = 60});
  std::vector<std::unique_ptr<Socket>> sockets;
  for (int i = 0; i < 3; ++i) sockets.push_back(std::make_unique<Socket>(port()));
  EXPECT_TRUE(sockets[0]->Closed(kSoon));
  EXPECT_TRUE(sockets[1]->Closed(kSoon));  // two were cut, an eighth of all, and are not closed
  Socket waiting(port());
  EXPECT_FALSE(waiting.Closed(kAWhile));
  EXPECT_FALSE(sockets[2]->Closed(milliseconds(0)));
  CloseTaken();
  WaitFor([&] { return connections_->size() == 1 && connections_->newcomers() == 1; });
  EXPECT_FALSE(waiting.Closed(kAWhile));
}

TEST_F(ListenerTest, WhatGrpcClosedIsForgotten) {
  Start({.max_connections = 4, .max_newcomers = 2});
  for (int round = 0; round < 5; ++round) {
    Socket one(port()), two(port());
    WaitFor([&] { return connections_->size() == 2; });
    CloseTaken();
    EXPECT_TRUE(one.Closed(kSoon));
    WaitFor([&] { return connections_->size() == 0; });
  }
}

TEST_F(ListenerTest, ItIsNotDeafAfterDescriptorsWereShort) {
  if (kBuiltWithSanitizer) GTEST_SKIP() << "UBSan needs descriptors to see whether memory is there";
  Start({.newcomer_seconds = 60});
  rlimit before = {};
  getrlimit(RLIMIT_NOFILE, &before);
  Socket client(port());
  Socket waiting(port());
  WaitFor([&] { return connections_->size() == 2; });
  rlimit none = before;
  none.rlim_cur = 3;
  {
    // Made before the limit is, and connected under it.
    const int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    setrlimit(RLIMIT_NOFILE, &none);
    EXPECT_TRUE(Connects(fd, port()));
    std::this_thread::sleep_for(kAWhile);
    EXPECT_LE(connections_->size(), 2);
    setrlimit(RLIMIT_NOFILE, &before);
    close(fd);
  }
  const int known = connections_->size();
  Socket after(port());
  WaitFor([&] { return connections_->size() > known; });
}

TEST_F(ListenerTest, WhoOwesTheRestOfARequestForTooLongIsCut) {
  ConnectionCounts counts;
  counts.calls.unfinished_seconds = 0.5;
  Start(counts);
  Socket owes(port()), whole(port()), refused(port());
  WaitFor([&] { return connections_->size() == 3; });
  Known(owes, 1, "alice");
  Known(whole, 2, "alice");
  Known(refused, 3, "alice");
  EXPECT_TRUE(connections_->OpenCall(1, "alice"));
  EXPECT_TRUE(connections_->OpenCall(3, "alice"));
  owes.Send(20'000);
  refused.Send(1000);
  EXPECT_TRUE(owes.Closed(kSoon));
  EXPECT_FALSE(whole.Closed(kAWhile));
  EXPECT_FALSE(refused.Closed(kAWhile));
}

TEST_F(ListenerTest, TheClientThatOwesMostIsCutWhenTheRoomIsUsedUp) {
  ConnectionCounts counts;
  counts.calls.unfinished_bytes = 10'000;
  Start(counts);
  Socket large(port()), small(port()), other(port()), uploads(port());
  WaitFor([&] { return connections_->size() == 4; });
  Known(large, 1, "alice");
  Known(small, 2, "alice");
  Known(other, 3, "bob");
  Known(uploads, 4, "carol");
  for (const uint64_t number : {1, 2, 3, 4}) EXPECT_TRUE(connections_->OpenCall(number, "alice"));
  connections_->WholeCall(4, uploads.name(), true);
  for (int i = 0; i < 10; ++i) {
    uploads.Send(1000);
    connections_->ReadOfCall(4, 1000);
  }
  small.Send(2000);
  other.Send(4000);
  large.Send(2500);
  EXPECT_FALSE(large.Closed(kAWhile));
  large.Send(1000);  // alice has more than half
  EXPECT_TRUE(large.Closed(kSoon));
  EXPECT_FALSE(small.Closed(kAWhile));
  EXPECT_FALSE(other.Closed(milliseconds(0)));
  EXPECT_FALSE(uploads.Closed(milliseconds(0)));
}

TEST_F(ListenerTest, OfACrowdOfStrangersThoseWhoSentMostAreCut) {
  Start({.newcomer_seconds = 60, .crowd_calls = 10, .crowd_bytes = 5000});
  Socket hostile(port(), "127.0.0.2"), same(port(), "127.0.0.2"), honest(port(), "127.0.0.9");
  WaitFor([&] { return connections_->size() == 3; });
  hostile.Send(4000);
  same.Send(2000);
  honest.Send(2500);
  std::this_thread::sleep_for(kAWhile);
  for (int i = 0; i < 9; ++i) connections_->OpenCall(7, std::nullopt);
  EXPECT_FALSE(hostile.Closed(kAWhile));
  for (int i = 0; i < 20; ++i) connections_->OpenCall(7, std::nullopt);
  EXPECT_TRUE(hostile.Closed(kSoon));
  EXPECT_FALSE(same.Closed(kAWhile));
  EXPECT_FALSE(honest.Closed(milliseconds(0)));
}

class OpenCallsTest : public ::testing::Test {
 protected:
  bool Open(uint64_t connection, const std::optional<std::string>& client) {
    return calls_.Open(connection, client, now_);
  }
  int Opened(uint64_t connection, const std::optional<std::string>& client) {
    int count = 0;
    while (Open(connection, client)) ++count;
    return count;
  }

  const OpenCalls::Clock::time_point now_ = OpenCalls::Clock::now();
  OpenCalls calls_{{.of_stranger = 3, .of_connection = 5, .of_client = 7}};
};

TEST_F(OpenCallsTest, AStrangerAConnectionAndAClientHaveSoMany) {
  EXPECT_EQ(Opened(1, std::nullopt), 3);
  EXPECT_EQ(Opened(2, "alice"), 5);
  EXPECT_EQ(Opened(3, "alice"), 2);
  EXPECT_EQ(Opened(4, "bob"), 5);
  EXPECT_EQ(Opened(1, "alice"), 0) << "the three belong to whoever is known afterwards";
  EXPECT_EQ(Opened(5, ""), 5);
  EXPECT_EQ(Opened(6, ""), 5) << "without names there are no clients";
}

TEST_F(OpenCallsTest, WhatEndsOrIsForgottenCountsNoMore) {
  EXPECT_EQ(Opened(1, "alice"), 5);
  EXPECT_EQ(Opened(2, "alice"), 2);
  calls_.Whole(1, false);
  EXPECT_FALSE(Open(1, "alice"));
  calls_.End(1, false);
  EXPECT_TRUE(Open(1, "alice"));
  calls_.Forget(1);
  calls_.End(1, false);  // of a connection that is gone
  EXPECT_EQ(Opened(2, "alice"), 3);
  calls_.ForgetUnknown(now_ + std::chrono::seconds(1));
  EXPECT_EQ(Opened(2, "alice"), 5);
}

TEST_F(ListenerTest, AnAddressInUseIsRefused) {
  Start({});
  const auto second = Listener::Open(absl::StrCat("127.0.0.1:", port()), 20);
  ASSERT_FALSE(second.ok());
  EXPECT_THAT(std::string(second.status().message()), HasSubstr("choose another --listen"));
  EXPECT_FALSE(Listener::Open("127.0.0.1", 20).ok());
  EXPECT_FALSE(Listener::Open("no.such.host.invalid:1", 20).ok());
}

TEST_F(ListenerTest, AnyAddressIsReachedByThisMachine) {
  for (const char* address : {"0.0.0.0:0", "[::]:0", "localhost:0"}) {
    const auto listener = Listener::Open(address, 20);
    ASSERT_TRUE(listener.ok()) << listener.status();
    EXPECT_GT((*listener)->port(), 0);
    EXPECT_THAT((*listener)->own_address(), HasSubstr(absl::StrCat((*listener)->port())));
    const Socket client((*listener)->port());
  }
}

TEST(Peers, AreReadAsGrpcWritesThem) {
  const auto v4 = ParsePeer("ipv4:192.0.2.7:4711");
  ASSERT_TRUE(v4);
  EXPECT_EQ(v4->Text(), "192.0.2.7:4711");
  EXPECT_EQ(v4->Network(), "192.0.2.7");
  const auto v6 = ParsePeer("ipv6:%5B2001:db8:1:2:3::7%5D:65535");
  ASSERT_TRUE(v6);
  EXPECT_EQ(v6->Text(), "[2001:db8:1:2:3::7]:65535");
  EXPECT_EQ(v6->Network(), "[2001:db8:1:2::]");
  EXPECT_EQ(ParsePeer("ipv6:%5B::ffff:192.0.2.7%5D:4711"), v4);
  EXPECT_EQ(ParsePeer("for:" + v6->Text()), v6);
  EXPECT_EQ(ParsePeer("ipv6:%5Bfe80::1%25eth0%5D:1")->Text(), "[fe80::1]:1");
  for (const char* bad : {"", "inproc", "unix:", "unix:/a", "ipv4:1.2.3.4", "ipv4:1.2.3.4:70000",
                          "ipv4:1.2.3:4x", "ipv6:%5B%5D:1", "ipv4::1"}) {
    EXPECT_FALSE(ParsePeer(bad)) << bad;
  }
}

TEST(LineRateTest, SomeLinesOfAKindPassAndTheRestIsCounted) {
  LineRate rate;
  const auto now = LineRate::Clock::now();
  std::string ending;
  int passed = 0;
  for (int i = 0; i < 1000; ++i) passed += rate.Pass("a", &ending, now);
  EXPECT_EQ(passed, 20);
  EXPECT_TRUE(rate.Pass("b", &ending, now));
  EXPECT_EQ(ending, "");
  EXPECT_TRUE(rate.Pass("a", &ending, now + std::chrono::seconds(11)));
  EXPECT_EQ(ending, " (980 more like it were left out)");
}

TEST(LineRateTest, ManyKindsAreNoWayRoundIt) {
  LineRate rate;
  const auto now = LineRate::Clock::now();
  std::string ending;
  int passed = 0;
  for (int i = 0; i < 10'000; ++i) passed += rate.Pass(absl::StrCat(i), &ending, now);
  EXPECT_LE(passed, 300);
}

// In a process of its own: its exit code is what fits of both, at least `low` of each.
void ExitWithShares(rlim_t soft, rlim_t hard, ConnectionShares wanted, int low) {
  const rlimit limit = {soft, hard};
  setrlimit(RLIMIT_NOFILE, &limit);
  const ConnectionShares fit = ShareDescriptors(wanted);
  std::exit(fit.first < low || fit.second < low ? 0 : fit.first + fit.second);
}

TEST(Descriptors, TheLimitIsRaisedAndConnectionsFitBelowIt) {
  using ::testing::ExitedWithCode;
  EXPECT_EXIT(ExitWithShares(64, 1024, {150, 50}, 50), ExitedWithCode(200), "");
}

TEST(Descriptors, TwoListenersShareWhatFits) {
  using ::testing::ExitedWithCode;
  EXPECT_EXIT(ExitWithShares(256, 256, {4096, 256}, 48), ExitedWithCode(96), "");
  EXPECT_EXIT(ExitWithShares(256, 256, {4096, 10}, 10), ExitedWithCode(96), "");
  EXPECT_EXIT(ExitWithShares(256, 256, {4096, 0}, 0), ExitedWithCode(96), "");
}

}  // namespace
}  // namespace litags
