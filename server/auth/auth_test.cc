#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <thread>

#include "engine/core/error_test_util.h"
#include "engine/core/sandbox.h"
#include "engine/core/temp_dir_test_util.h"
#include "server/auth/authenticator.h"
#include "server/auth/file_stamp.h"
#include "server/auth/tls.h"
#include "server/auth/tokens.h"
#include "server/store/digest.h"
#include "server/testing/certificates.h"

namespace litags {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

std::string Field(const absl::Status& status) {
  const auto detail = GetErrorDetail(status);
  return detail ? detail->field : "";
}

TEST(Tokens, HaveTwoHundredFiftySixRandomBits) {
  const std::string token = MakeToken();
  EXPECT_THAT(token, ::testing::MatchesRegex("litags_[0-9a-f]{64}"));
  EXPECT_NE(token, MakeToken());
}

TEST(Tokens, TableFindsTheNameAndHoldsOnlyDigests) {
  const std::string alice = MakeToken(), alice_new = MakeToken(), bob = MakeToken();
  const std::string text = "# clients\n\n" + TokenEntry("alice", alice) + "\r\n" +
                           TokenEntry("bob", bob) + "\n" + TokenEntry("alice", alice_new);
  EXPECT_THAT(text, Not(HasSubstr(alice.substr(7))));
  TokenTable table;
  ASSERT_TRUE(table.AddLines(text, "tokens").ok());
  EXPECT_EQ(table.size(), 3u);
  EXPECT_EQ(table.Find(alice), "alice");
  EXPECT_EQ(table.Find(alice_new), "alice");
  EXPECT_EQ(table.Find(bob), "bob");
  EXPECT_EQ(table.Find(MakeToken()), std::nullopt);
  EXPECT_EQ(table.Find(""), std::nullopt);
  // The digest, which someone may have read from a backup, opens nothing.
  EXPECT_EQ(table.Find(Sha256::Hex(alice)), std::nullopt);
}

TEST(Tokens, BrokenEntriesAreRefusedWithTheirLineAndWithoutTheirDigest) {
  const std::string good = TokenEntry("alice", "t");
  const std::string digest = Sha256::Hex("t");
  const std::string entry = "TOKEN_ENTRY_INVALID", name = "CLIENT_NAME_INVALID";
  const std::pair<std::string, std::string> broken[] = {
      {"alice", entry},
      {"alice:" + digest, entry},
      {"alice:sha256:" + digest.substr(1), entry},
      {"alice:md5:" + digest, entry},
      {":sha256:" + digest, name},
      {"a b:sha256:" + digest, name},
      {good + "00", entry},
      {"alice:sha256:" + std::string(64, 'G'), entry}};
  for (const auto& [bad, reason] : broken) {
    TokenTable table;
    const absl::Status status = table.AddLines(good + "\n" + bad, "tokens");
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << bad;
    EXPECT_EQ(Reason(status), reason) << bad;
    EXPECT_EQ(Field(status), "tokens line 2") << bad;
    EXPECT_THAT(std::string(status.message()), Not(HasSubstr(digest.substr(1)))) << bad;
  }
}

TEST(Tokens, FileIsPrivateAndHoldsNoToken) {
  TempDir dir;
  const std::string path = dir.path() + "/tokens";
  const auto token = AddTokenToFile("alice", path);
  ASSERT_TRUE(token.ok()) << token.status();
  ASSERT_TRUE(AddTokenToFile("bob", path).ok());
  struct stat info = {};
  ASSERT_EQ(stat(path.c_str(), &info), 0);
  EXPECT_EQ(info.st_mode & 0777, 0600u);
  std::ifstream file(path);
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  EXPECT_THAT(text, Not(HasSubstr(token->substr(7))));
  TokenTable table;
  ASSERT_TRUE(table.AddLines(text, path).ok());
  EXPECT_EQ(table.Find(*token), "alice");
  EXPECT_EQ(Reason(AddTokenToFile("a/b", path).status()), "CLIENT_NAME_INVALID");
  EXPECT_EQ(Reason(AddTokenToFile("a", dir.path() + "/no/tokens").status()), "TOKENS_NOT_WRITTEN");
}

TEST(Tokens, AFileWithoutRoomForAnEntryStaysAsItWas) {
  TempDir dir;
  const std::string path = dir.path() + "/tokens";
  ASSERT_TRUE(AddTokenToFile("alice", path).ok());
  const auto size = std::filesystem::file_size(path);
  const auto add_within = [&](rlim_t bytes) {
    rlimit most = {};
    getrlimit(RLIMIT_FSIZE, &most);
    const rlimit limit = {bytes, most.rlim_max};
    const auto handler = signal(SIGXFSZ, SIG_IGN);
    setrlimit(RLIMIT_FSIZE, &limit);
    const absl::Status status = AddTokenToFile("bob", path).status();
    setrlimit(RLIMIT_FSIZE, &most);
    signal(SIGXFSZ, handler);
    return status;
  };
  const absl::Status half = add_within(size + 20), none = add_within(size);
  EXPECT_EQ(Reason(half), "TOKENS_NOT_WRITTEN");
  EXPECT_THAT(std::string(half.message()), HasSubstr(std::strerror(ENOSPC)));
  EXPECT_THAT(std::string(none.message()), HasSubstr(std::strerror(EFBIG)));
  EXPECT_EQ(std::filesystem::file_size(path), size);
}

TEST(Tokens, WhatHelpsAgainstAFileThatCannotBeReadIsToldByWhy) {
  const auto told = [](int error) { return std::string(TokensUnreadable("t", error).message()); };
  EXPECT_THAT(told(ENOENT), HasSubstr("make the file with"));
  EXPECT_THAT(told(EACCES), HasSubstr("give a file that the server's user may read"));
  TempDir dir;
  AuthOptions folder;
  folder.tokens_path = dir.path();
  EXPECT_EQ(Authenticator::Make(folder).status().message(),
            TokensUnreadable(dir.path(), 0).message());
}

TEST(FileStamp, DiffersWhereOnlyPermissionsHaveChanged) {
  TempDir dir;
  const std::string path = dir.path() + "/tokens";
  std::ofstream(path) << "# nobody\n";
  ASSERT_EQ(chmod(path.c_str(), 0), 0);
  const FileStamp before = FileStamp::Of(path);
  EXPECT_EQ(FileStamp::Of(path), before);
  std::this_thread::sleep_for(std::chrono::milliseconds(50));  // file systems' clocks are coarse
  ASSERT_EQ(chmod(path.c_str(), 0640), 0);
  EXPECT_NE(FileStamp::Of(path), before);
}

TEST(Tokens, EntryIsALineOfItsOwnAlsoBehindALineWithoutItsEnd) {
  TempDir dir;
  const std::string path = dir.path() + "/tokens";
  std::ofstream(path) << "# clients\n" << TokenEntry("alice", "secret");
  const auto bob = AddTokenToFile("bob", path), carol = AddTokenToFile("carol", path);
  ASSERT_TRUE(bob.ok() && carol.ok());
  std::ifstream file(path);
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 4) << text;
  TokenTable table;
  ASSERT_TRUE(table.AddLines(text, path).ok());
  EXPECT_EQ(table.Find("secret"), "alice");
  EXPECT_EQ(table.Find(*bob), "bob");
  EXPECT_EQ(table.Find(*carol), "carol");
}

void WaitForTheNextLook() { std::this_thread::sleep_for(std::chrono::milliseconds(1100)); }

TEST(Authenticator, WithoutAuthenticationEverybodyIsTheOperator) {
  auto authenticator = Authenticator::Make({});
  ASSERT_TRUE(authenticator.ok());
  const auto caller = (*authenticator)->Identify("Bearer whatever", std::nullopt);
  ASSERT_TRUE(caller.ok());
  EXPECT_EQ(caller->name, "");
  EXPECT_TRUE(caller->admin);
}

TEST(Authenticator, TokenNamesTheClientAndEverythingElseIsRefused) {
  AuthOptions options;
  const std::string alice = MakeToken(), root = MakeToken();
  options.token_entries = {TokenEntry("alice", alice), TokenEntry("root", root)};
  options.admins = {"root"};
  auto made = Authenticator::Make(options);
  ASSERT_TRUE(made.ok()) << made.status();
  Authenticator& authenticator = **made;
  EXPECT_EQ(authenticator.Identify("Bearer " + alice, {})->name, "alice");
  EXPECT_FALSE(authenticator.Identify("bearer " + alice, {})->admin);
  EXPECT_TRUE(authenticator.Identify("Bearer " + root, {})->admin);
  const auto reason = [&](std::optional<std::string_view> header) {
    const absl::Status status = authenticator.Identify(header, {}).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kUnauthenticated);
    EXPECT_THAT(std::string(status.message()), Not(HasSubstr(alice.substr(7, 32))));
    return Reason(status);
  };
  EXPECT_EQ(reason(std::nullopt), "TOKEN_MISSING");
  for (const std::string& bad :
       {std::string(), std::string("Bearer "), alice, "Basic " + alice, "Bearer " + alice + " ",
        "Bearer " + alice.substr(0, 70), "Bearer " + std::string(100'000, 'x')}) {
    EXPECT_EQ(reason(bad), "TOKEN_INVALID") << bad.substr(0, 100);
  }
  // A certificate counts only where TLS has verified one.
  EXPECT_FALSE(authenticator.Identify({}, "alice").ok());
}

TEST(Authenticator, CertificateNamesTheClientUnlessATokenDoes) {
  AuthOptions options;
  const std::string alice = MakeToken();
  options.token_entries = {TokenEntry("alice", alice)};
  options.client_certificates = true;
  options.admins = {"ops.example"};
  auto made = Authenticator::Make(options);
  ASSERT_TRUE(made.ok());
  EXPECT_TRUE((*made)->Identify({}, "ops.example")->admin);
  EXPECT_EQ((*made)->Identify("Bearer " + alice, "ops.example")->name, "alice");
  EXPECT_EQ(Reason((*made)->Identify("Bearer no", "ops.example").status()), "TOKEN_INVALID");
  EXPECT_EQ(Reason((*made)->Identify({}, "not a name").status()), "CERTIFICATE_NAME_INVALID");
}

TEST(Authenticator, TokenTakenOutOfTheFileStopsWorkingWithinSeconds) {
  TempDir dir;
  AuthOptions options;
  options.tokens_path = dir.path() + "/tokens";
  EXPECT_EQ(Reason(Authenticator::Make(options).status()), "TOKENS_UNREADABLE");
  const std::string alice = *AddTokenToFile("alice", options.tokens_path);
  auto made = Authenticator::Make(options);
  ASSERT_TRUE(made.ok()) << made.status();
  const auto works = [&](const std::string& token) {
    return (*made)->Identify("Bearer " + token, {}).ok();
  };
  EXPECT_TRUE(works(alice));
  // A file in the middle of being edited changes nothing.
  std::ofstream(options.tokens_path) << "garbage\n";
  WaitForTheNextLook();
  EXPECT_TRUE(works(alice));
  std::ofstream(options.tokens_path) << "# nobody\n";
  WaitForTheNextLook();
  EXPECT_FALSE(works(alice));
  const std::string bob = *AddTokenToFile("bob", options.tokens_path);
  WaitForTheNextLook();
  EXPECT_TRUE(works(bob));
}

// While it lives, no file can be opened.
class NoDescriptors {
 public:
  NoDescriptors() {
    getrlimit(RLIMIT_NOFILE, &before_);
    const rlimit none = {0, before_.rlim_max};
    setrlimit(RLIMIT_NOFILE, &none);
  }
  ~NoDescriptors() { setrlimit(RLIMIT_NOFILE, &before_); }

 private:
  rlimit before_ = {};
};

TEST(Authenticator, FileThatCouldNotBeReadOnceIsReadAgain) {
  if (kBuiltWithSanitizer) GTEST_SKIP() << "UBSan needs descriptors to see whether memory is there";
  TempDir dir;
  AuthOptions options;
  options.tokens_path = dir.path() + "/tokens";
  const std::string alice = *AddTokenToFile("alice", options.tokens_path);
  auto made = Authenticator::Make(options);
  ASSERT_TRUE(made.ok()) << made.status();
  std::ofstream(options.tokens_path) << "# nobody\n";
  WaitForTheNextLook();
  {
    const NoDescriptors none;
    EXPECT_TRUE((*made)->Identify("Bearer " + alice, {}).ok());
  }
  WaitForTheNextLook();
  EXPECT_FALSE((*made)->Identify("Bearer " + alice, {}).ok());
}

class Tls : public ::testing::Test {
 protected:
  Tls() {
    authority_.Issue("server");
    authority_.Issue("other");
  }
  absl::Status Load(const std::string& cert, const std::string& key, const std::string& ca = "") {
    return LoadTls({cert.empty() ? "" : authority_.Path(cert),
                    key.empty() ? "" : authority_.Path(key), ca.empty() ? "" : authority_.Path(ca)})
        .status();
  }
  TempDir dir_;
  TestAuthority authority_{dir_.path()};
};

TEST_F(Tls, MatchingFilesLoad) {
  const auto material = LoadTls(
      {authority_.Path("server.crt"), authority_.Path("server.key"), authority_.Path("ca.crt")});
  ASSERT_TRUE(material.ok()) << material.status();
  EXPECT_EQ(material->cert, authority_.Read("server.crt"));
  EXPECT_EQ(material->key, authority_.Read("server.key"));
  EXPECT_EQ(material->client_ca, authority_.Read("ca.crt"));
  EXPECT_THAT(material->expires, HasSubstr("20"));
}

TEST_F(Tls, ChainsAndSeveralAuthoritiesLoad) {
  std::ofstream(authority_.Path("chain.crt"))
      << authority_.Read("server.crt") << authority_.Read("ca.crt") << "\n";
  std::ofstream(authority_.Path("two.crt")) << authority_.Read("ca.crt") << "# another\n"
                                            << authority_.Read("other.crt");
  EXPECT_TRUE(Load("chain.crt", "server.key", "two.crt").ok());
}

TEST_F(Tls, EveryWrongFileIsNamedWithItsFlag) {
  authority_.Issue("ended", -60);
  std::ofstream(authority_.Path("empty.pem"));
  std::ofstream(authority_.Path("garbage.pem")) << "-----BEGIN CERTIFICATE-----\ngarbage\n";
  const std::string authority = authority_.Read("ca.crt");
  const std::string cut = authority.substr(0, authority.size() / 2);
  std::ofstream(authority_.Path("cut_chain.crt")) << authority_.Read("server.crt") << cut;
  std::ofstream(authority_.Path("cut_ca.crt")) << authority << cut;
  authority_.IssueWeak("weak");
  std::ofstream(authority_.Path("weak_chain.crt"))
      << authority_.Read("server.crt") << authority_.Read("weak.crt");
  const struct {
    const char *cert, *key, *ca, *reason, *flag;
  } kCases[] = {
      {"", "server.key", "", "TLS_INCOMPLETE", "--tls-cert"},
      {"server.crt", "", "", "TLS_INCOMPLETE", "--tls-key"},
      {"", "", "ca.crt", "TLS_INCOMPLETE", "--tls-cert"},
      {"missing.crt", "server.key", "", "TLS_FILE_UNREADABLE", "--tls-cert"},
      {"server.crt", "missing.key", "", "TLS_FILE_UNREADABLE", "--tls-key"},
      {"server.crt", "server.key", "missing.crt", "TLS_FILE_UNREADABLE", "--tls-client-ca"},
      {"empty.pem", "server.key", "", "TLS_FILE_UNREADABLE", "--tls-cert"},
      {"garbage.pem", "server.key", "", "TLS_FILE_INVALID", "--tls-cert"},
      {"server.key", "server.key", "", "TLS_FILE_INVALID", "--tls-cert"},
      {"server.crt", "server.crt", "", "TLS_FILE_INVALID", "--tls-key"},
      {"server.crt", "server.key", "server.key", "TLS_FILE_INVALID", "--tls-client-ca"},
      {"cut_chain.crt", "server.key", "", "TLS_FILE_INVALID", "--tls-cert"},
      {"server.crt", "server.key", "cut_ca.crt", "TLS_FILE_INVALID", "--tls-client-ca"},
      {"weak.crt", "weak.key", "", "TLS_FILE_INVALID", "--tls-cert"},
      {"weak_chain.crt", "server.key", "", "TLS_FILE_INVALID", "--tls-cert"},
      {"server.crt", "other.key", "", "TLS_KEY_MISMATCH", "--tls-key"},
      {"ended.crt", "ended.key", "", "TLS_CERTIFICATE_EXPIRED", "--tls-cert"},
  };
  for (const auto& c : kCases) {
    const absl::Status status = Load(c.cert, c.key, c.ca);
    EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition) << c.cert << " " << c.key;
    EXPECT_EQ(Reason(status), c.reason) << status;
    EXPECT_EQ(Field(status), c.flag) << status;
  }
}

TEST_F(Tls, FilesThatCouldNotBeReadOnceAreReadAgain) {
  if (kBuiltWithSanitizer) GTEST_SKIP() << "UBSan needs descriptors to see whether memory is there";
  const auto files =
      TlsFiles::Open({authority_.Path("server.crt"), authority_.Path("server.key"), ""});
  ASSERT_TRUE(files.ok()) << files.status();
  EXPECT_TRUE((*files)->TakeRenewed().has_value());
  authority_.Issue("server");
  WaitForTheNextLook();
  {
    const NoDescriptors none;
    EXPECT_FALSE((*files)->TakeRenewed().has_value());
  }
  WaitForTheNextLook();
  const auto renewed = (*files)->TakeRenewed();
  ASSERT_TRUE(renewed.has_value());
  EXPECT_EQ(renewed->cert, authority_.Read("server.crt"));
}

TEST(Loopback, IsToldFromAddressesThatOthersReach) {
  for (const char* address :
       {"127.0.0.1:1", "127.1.2.3:50051", "localhost:1", "[::1]:1", "unix:/run/litags.sock"}) {
    EXPECT_TRUE(IsLoopback(address)) << address;
  }
  for (const char* address :
       {"0.0.0.0:1", "[::]:1", "192.168.0.1:1", "example.org:1", "127.0.0.1.example.org:1",
        "unixbox:1", "localhost.example.org:1", ":1", ""}) {
    EXPECT_FALSE(IsLoopback(address)) << address;
  }
  for (const char* host : {"127.0.0.1", "localhost", "[::1]", "::1"}) {
    EXPECT_TRUE(IsLoopbackHost(host)) << host;
  }
  for (const char* host : {"unix", "unix:", "unix-abstract:", "localhost:1", "example.org", ""}) {
    EXPECT_FALSE(IsLoopbackHost(host)) << host;
  }
}

}  // namespace
}  // namespace litags
