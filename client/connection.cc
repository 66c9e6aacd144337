#include "client/connection.h"

#include <netdb.h>
#include <sys/socket.h>

#include <algorithm>
#include <fstream>
#include <random>
#include <utility>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "client/status.h"
#include "grpcpp/create_channel.h"
#include "grpcpp/security/credentials.h"
#include "grpcpp/support/client_interceptor.h"
#include "proto/litags/v1/limits.h"

namespace litags::client {
namespace {

namespace experimental = grpc::experimental;

constexpr int kConnectMs = 5000;
constexpr int kReconnectMinMs = 200;
constexpr int kReconnectMaxMs = 2000;
constexpr size_t kMaxFileBytes = 1 << 20;

std::vector<std::string> ServersOf(const ConnectionOptions& options) {
  std::vector<std::string> servers = absl::StrSplit(options.server, ',', absl::SkipWhitespace());
  for (std::string& server : servers) absl::StripAsciiWhitespace(&server);
  return servers;
}

std::string HostOf(const std::string& server) { return server.substr(0, server.rfind(':')); }

// What is wrong with the form of an address; OK for those that gRPC takes as they are.
absl::Status CheckForm(const std::string& server) {
  for (const std::string scheme : {"http://", "https://"}) {
    if (!absl::StartsWithIgnoreCase(server, scheme)) continue;
    return BadInput("SERVER_UNKNOWN", "--server",
                    absl::StrCat(server, ": leave out ", scheme, "; an address is HOST:PORT",
                                 scheme == "https://" ? ", and --tls encrypts" : ""));
  }
  if (server.starts_with("unix:")) return absl::OkStatus();
  const size_t colon = server.rfind(':');
  const size_t bracket = server.rfind(']');  // the end of an IPv6 address
  int port = 0;
  if (colon != std::string::npos && (bracket == std::string::npos || bracket < colon) &&
      absl::SimpleAtoi(server.substr(colon + 1), &port) && port > 0 && port < 65536) {
    return absl::OkStatus();
  }
  return BadInput("SERVER_UNKNOWN", "--server",
                  absl::StrCat("no port in \"", server,
                               "\"; write HOST:PORT, as 127.0.0.1:50051, with a port of 1 to "
                               "65535"));
}

bool IsSocket(const std::string& server) { return server.starts_with("unix:"); }

// The IPv4 addresses of host:port, as host:port.
absl::StatusOr<std::vector<std::string>> Resolve(const std::string& server) {
  if (IsSocket(server)) {
    return BadInput("SERVER_UNKNOWN", "--server",
                    absl::StrCat(server, " is a socket, which stands alone, not among servers"));
  }
  const std::string host = HostOf(server);
  const std::string port = server.substr(std::min(server.size(), host.size() + 1));
  addrinfo hints = {};
  hints.ai_family = AF_INET;
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  const int error = getaddrinfo(host.c_str(), port.c_str(), &hints, &found);
  std::vector<std::string> addresses;
  for (const addrinfo* a = found; error == 0 && a; a = a->ai_next) {
    char number[NI_MAXHOST];
    if (getnameinfo(a->ai_addr, a->ai_addrlen, number, sizeof(number), nullptr, 0,
                    NI_NUMERICHOST) == 0) {
      addresses.push_back(absl::StrCat(number, ":", port));
    }
  }
  if (error == 0) freeaddrinfo(found);
  if (!addresses.empty() && !port.empty()) return addresses;
  return BadInput("SERVER_UNKNOWN", "--server",
                  absl::StrCat(server, " has no IPv4 address and port",
                               error ? absl::StrCat(" (", gai_strerror(error), ")") : "",
                               "; several servers are written host:port,host:port"));
}

// What gRPC calls the servers. Several are one name with many addresses, of which gRPC holds on to
// the first that answers. Their order is drawn, so that clients share out among the servers.
absl::StatusOr<std::string> TargetOf(const std::vector<std::string>& servers) {
  if (servers.size() == 1) return servers[0];
  std::vector<std::string> addresses;
  for (const std::string& server : servers) {
    auto resolved = Resolve(server);
    if (!resolved.ok()) return resolved.status();
    addresses.insert(addresses.end(), resolved->begin(), resolved->end());
  }
  std::shuffle(addresses.begin(), addresses.end(), std::mt19937(std::random_device()()));
  return absl::StrCat("ipv4:", absl::StrJoin(addresses, ","));
}

bool IsLoopback(const std::string& server) {
  if (IsSocket(server)) return true;
  const std::string host = HostOf(server);
  return host == "localhost" || host == "[::1]" ||
         (host.starts_with("127.") && host.find_first_not_of("0123456789.") == std::string::npos);
}

// Adds the token to every call of a channel. Channel credentials could do it only over TLS, and
// tokens are of use on one machine too.
class TokenInterceptor : public experimental::Interceptor {
 public:
  explicit TokenInterceptor(std::string authorization) : authorization_(std::move(authorization)) {}
  void Intercept(experimental::InterceptorBatchMethods* methods) override {
    using experimental::InterceptionHookPoints;
    if (methods->QueryInterceptionHookPoint(InterceptionHookPoints::PRE_SEND_INITIAL_METADATA)) {
      methods->GetSendInitialMetadata()->insert({"authorization", authorization_});
    }
    methods->Proceed();
  }

 private:
  const std::string authorization_;
};

class TokenInterceptorFactory : public experimental::ClientInterceptorFactoryInterface {
 public:
  explicit TokenInterceptorFactory(const std::string& token)
      : authorization_(absl::StrCat("Bearer ", token)) {}
  experimental::Interceptor* CreateClientInterceptor(experimental::ClientRpcInfo*) override {
    return new TokenInterceptor(authorization_);
  }

 private:
  const std::string authorization_;
};

absl::StatusOr<std::string> ReadSmallFile(const std::string& path, std::string_view reason,
                                          std::string_view flag) {
  if (path.empty()) return std::string();
  std::ifstream file(path, std::ios::binary);
  std::string text(kMaxFileBytes, '\0');
  file.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<size_t>(file.gcount()));
  if (text.empty()) {
    return BadInput(reason, flag,
                    absl::StrCat("cannot read ", path,
                                 ", or it is empty; check the path and who "
                                 "may read it"));
  }
  return text;
}

bool UsesTls(const ConnectionOptions& options) {
  return options.tls || !options.tls_ca.empty() || !options.tls_cert.empty() ||
         !options.tls_key.empty() || !options.tls_name.empty();
}

absl::StatusOr<std::shared_ptr<grpc::ChannelCredentials>> CredentialsOf(
    const ConnectionOptions& options) {
  if (!UsesTls(options)) return grpc::InsecureChannelCredentials();
  if (options.tls_cert.empty() != options.tls_key.empty()) {
    return BadInput("TLS_INCOMPLETE", options.tls_cert.empty() ? "--tls-cert" : "--tls-key",
                    "--tls-cert and --tls-key belong together; give both");
  }
  grpc::SslCredentialsOptions ssl;
  for (const auto& [path, text, flag] :
       {std::tuple{&options.tls_ca, &ssl.pem_root_certs, "--tls-ca"},
        std::tuple{&options.tls_cert, &ssl.pem_cert_chain, "--tls-cert"},
        std::tuple{&options.tls_key, &ssl.pem_private_key, "--tls-key"}}) {
    auto read = ReadSmallFile(*path, "TLS_FILE_UNREADABLE", flag);
    if (!read.ok()) return read.status();
    *text = *std::move(read);
  }
  return grpc::SslCredentials(ssl);
}

absl::StatusOr<std::string> TokenOf(const ConnectionOptions& options) {
  std::string token = options.token;
  if (!options.token_file.empty()) {
    auto read = ReadSmallFile(options.token_file, "TOKEN_UNREADABLE", "--token-file");
    if (!read.ok()) return read.status();
    token = *std::move(read);
  }
  while (!token.empty() && (token.back() == '\n' || token.back() == '\r')) token.pop_back();
  // Anything else cannot be sent as a header, and never was a token.
  if (!std::all_of(token.begin(), token.end(), [](char c) { return c > ' ' && c < 0x7f; })) {
    return BadInput("TOKEN_INVALID", options.token_file.empty() ? "LITAGS_TOKEN" : "--token-file",
                    "a token is one line of letters, digits and punctuation; give the one that "
                    "the operator made");
  }
  return token;
}

// `here`: all servers are on this machine.
grpc::ChannelArguments ChannelArguments(const ConnectionOptions& options,
                                        const std::vector<std::string>& servers, bool here) {
  grpc::ChannelArguments args;
  args.SetMaxReceiveMessageSize(v1::kMaxAnswerBytes);
  args.SetInt(GRPC_ARG_INITIAL_RECONNECT_BACKOFF_MS, kReconnectMinMs);
  args.SetInt(GRPC_ARG_MAX_RECONNECT_BACKOFF_MS, kReconnectMaxMs);
  args.SetInt(GRPC_ARG_MIN_RECONNECT_BACKOFF_MS, kConnectMs);
  args.SetInt(GRPC_ARG_KEEPALIVE_TIME_MS, static_cast<int>(1000 * options.keepalive_seconds));
  args.SetInt(GRPC_ARG_KEEPALIVE_TIMEOUT_MS,
              static_cast<int>(1000 * options.keepalive_timeout_seconds));
  // By default gRPC stops asking after two times, and a watch sends nothing else.
  args.SetInt(GRPC_ARG_HTTP2_MAX_PINGS_WITHOUT_DATA, 0);
  // A proxy for the internet is no way to this machine.
  if (here) args.SetInt(GRPC_ARG_ENABLE_HTTP_PROXY, 0);
  if (!options.tls_name.empty()) {
    args.SetSslTargetNameOverride(options.tls_name);
  } else if (servers.size() > 1) {
    args.SetSslTargetNameOverride(HostOf(servers[0]));
  }
  return args;
}

}  // namespace

absl::StatusOr<std::shared_ptr<grpc::Channel>> Connect(const ConnectionOptions& options) {
  const std::vector<std::string> servers = ServersOf(options);
  if (servers.empty()) return BadInput("SERVER_UNKNOWN", "--server", "no server is named");
  for (const std::string& server : servers) {
    if (const absl::Status form = CheckForm(server); !form.ok()) return form;
  }
  const auto target = TargetOf(servers);
  if (!target.ok()) return target.status();
  const auto credentials = CredentialsOf(options);
  if (!credentials.ok()) return credentials.status();
  const auto token = TokenOf(options);
  if (!token.ok()) return token.status();
  const bool here = std::all_of(servers.begin(), servers.end(), IsLoopback);
  std::vector<std::unique_ptr<experimental::ClientInterceptorFactoryInterface>> interceptors;
  if (!token->empty()) {
    if (!UsesTls(options) && !here) {
      return BadInput("TOKEN_EXPOSED", "--token-file",
                      absl::StrCat("the token would travel to ", options.server,
                                   " unencrypted; use --tls or --tls-ca FILE"));
    }
    interceptors.push_back(std::make_unique<TokenInterceptorFactory>(*token));
  }
  return experimental::CreateCustomChannelWithInterceptors(
      *target, *credentials, ChannelArguments(options, servers, here), std::move(interceptors));
}

}  // namespace litags::client
