#include "client/connection.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>

#include "client/client.h"
#include "client/status.h"

namespace litags::client {
namespace {

namespace fs = std::filesystem;
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

TEST(Connection, FilesAndTokensThatCannotBeUsedAreNamedWithTheirFlag) {
  const std::string file = fs::temp_directory_path() / ("litags-connection-" + RandomId());
  std::ofstream(file) << "two\nlines\n";
  const struct {
    ConnectionOptions options;
    const char *reason, *field;
  } kCases[] = {
      {{.server = "127.0.0.1:1", .tls_ca = "/missing"}, "TLS_FILE_UNREADABLE", "--tls-ca"},
      {{.server = "127.0.0.1:1", .tls_cert = file}, "TLS_INCOMPLETE", "--tls-key"},
      {{.server = "127.0.0.1:1", .tls_key = file}, "TLS_INCOMPLETE", "--tls-cert"},
      {{.server = "127.0.0.1:1", .token_file = "/missing"}, "TOKEN_UNREADABLE", "--token-file"},
      {{.server = "127.0.0.1:1", .token_file = file}, "TOKEN_INVALID", "--token-file"},
      {{.server = "127.0.0.1:1", .token = "a b"}, "TOKEN_INVALID", "LITAGS_TOKEN"},
      {{.server = "example.org:1", .token = "secret"}, "TOKEN_EXPOSED", "--token-file"},
      {{.server = "127.0.0.1.example.org:1", .token = "secret"}, "TOKEN_EXPOSED", "--token-file"},
  };
  for (const auto& c : kCases) {
    const absl::Status status = Connect(c.options).status();
    EXPECT_TRUE(absl::IsInvalidArgument(status)) << c.reason;
    EXPECT_EQ(DetailOf(status).reason(), c.reason);
    EXPECT_EQ(DetailOf(status).field(), c.field);
    EXPECT_EQ(status.message().find("secret"), absl::string_view::npos);
  }
  EXPECT_TRUE(Connect({.server = "example.org:1", .tls = true, .token = "secret"}).ok());
  EXPECT_TRUE(Connect({.server = "unix:/run/litags.sock", .token = "secret"}).ok());
  std::remove(file.c_str());
}

TEST(Connection, ServersWithoutAnAddressAreRefusedWhereThereAreSeveral) {
  EXPECT_TRUE(Connect({.server = "127.0.0.1:1,localhost:2"}).ok());
  EXPECT_TRUE(Connect({.server = " 127.0.0.1:1 , 127.0.0.1:2,"}).ok());
  for (const char* server :
       {"", "127.0.0.1:1,127.0.0.1", "127.0.0.1:1,no.such.invalid:2", "127.0.0.1:1,unix:2"}) {
    const absl::Status status = Connect({.server = server}).status();
    EXPECT_EQ(DetailOf(status).reason(), "SERVER_UNKNOWN") << server;
    EXPECT_EQ(DetailOf(status).field(), "--server");
  }
  EXPECT_THAT(std::string(Connect({.server = "127.0.0.1:1,unix:2"}).status().message()),
              testing::HasSubstr("stands alone"));  // and is no host, were one called so
  // A token stays on this machine only if all of them are on it.
  EXPECT_EQ(
      DetailOf(Connect({.server = "127.0.0.1:1,192.0.2.1:2", .token = "x"}).status()).reason(),
      "TOKEN_EXPOSED");
}

}  // namespace
}  // namespace litags::client
