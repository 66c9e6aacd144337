#include "client/connection.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "client/status.h"

namespace litags::client {
namespace {

using ::testing::HasSubstr;

TEST(Connection, AddressesOfAnotherFormAreRefusedWithTheRightOne) {
  const struct {
    const char *server, *words;
  } kCases[] = {
      {"127.0.0.1", "no port in \"127.0.0.1\""},
      {"localhost:", "no port in"},
      {"localhost:0", "no port in"},
      {"localhost:65536", "no port in"},
      {"localhost:grpc", "no port in"},
      {"[::1]", "no port in"},
      {"127.0.0.1:1,localhost", "no port in \"localhost\""},
      {"http://127.0.0.1:50051", "leave out http://"},
      {"https://example.org", "leave out https://; an address is HOST:PORT, and --tls encrypts"},
  };
  for (const auto& c : kCases) {
    const absl::Status status = Connect({.server = c.server}).status();
    EXPECT_EQ(DetailOf(status).reason(), "SERVER_UNKNOWN") << c.server;
    EXPECT_EQ(DetailOf(status).field(), "--server");
    EXPECT_THAT(std::string(status.message()), HasSubstr(c.words));
  }
}

TEST(Connection, AddressesThatGrpcTakesAreTaken) {
  for (const char* server :
       {"localhost:1", "[::1]:1", "dns:///localhost:1", "unix:/tmp/litags.socket"}) {
    EXPECT_TRUE(Connect({.server = server}).ok()) << server;
  }
}

}  // namespace
}  // namespace litags::client
