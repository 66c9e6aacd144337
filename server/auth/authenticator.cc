#include "server/auth/authenticator.h"

#include <spdlog/spdlog.h>
#include <strings.h>

#include <cerrno>
#include <fstream>

#include "engine/core/counted.h"
#include "engine/core/error.h"

namespace litags {
namespace {

constexpr size_t kMaxTokensBytes = 4 << 20;
constexpr size_t kMaxAuthorizationLength = 512;

absl::Status Unauthenticated(std::string_view reason, std::string_view message) {
  return MakeError(absl::StatusCode::kUnauthenticated, reason, "authorization", message);
}

absl::StatusOr<std::string> ReadTokens(const std::string& path) {
  struct stat info = {};
  std::ifstream file(path, std::ios::binary);
  int error = file && stat(path.c_str(), &info) == 0 ? 0 : errno;
  if (error != 0 || !S_ISREG(info.st_mode)) return TokensUnreadable(path, error);
  std::string text(kMaxTokensBytes + 1, '\0');
  errno = 0;
  file.read(text.data(), static_cast<std::streamsize>(text.size()));
  error = file.bad() ? errno : 0;
  text.resize(static_cast<size_t>(file.gcount()));
  if (file.bad() || text.size() > kMaxTokensBytes) return TokensUnreadable(path, error);
  return text;
}

}  // namespace

absl::StatusOr<std::unique_ptr<Authenticator>> Authenticator::Make(AuthOptions options) {
  std::unique_ptr<Authenticator> made(new Authenticator(std::move(options)));
  for (const std::string& name : made->options_.admins) {
    LITAGS_RETURN_IF_ERROR(CheckClientName(name, "--admins"));
    made->admins_.insert(name);
  }
  LITAGS_RETURN_IF_ERROR(made->Load());
  return made;
}

absl::Status Authenticator::Load() {
  auto tokens = std::make_shared<TokenTable>();
  for (const std::string& entry : options_.token_entries) {
    LITAGS_RETURN_IF_ERROR(tokens->Add(entry, "--token"));
  }
  const std::string& path = options_.tokens_path;
  if (!path.empty()) {
    // Before reading: a change meanwhile is seen later. What could not be read is tried again.
    const FileStamp stamp = FileStamp::Of(path);
    LITAGS_ASSIGN_OR_RETURN(const std::string text, ReadTokens(path));
    file_ = stamp;
    LITAGS_RETURN_IF_ERROR(tokens->AddLines(text, path));
  }
  tokens_ = std::move(tokens);
  ++generation_;
  return absl::OkStatus();
}

std::shared_ptr<const TokenTable> Authenticator::Tokens() {
  std::lock_guard lock(mutex_);
  const auto now = std::chrono::steady_clock::now();
  if (!options_.tokens_path.empty() && now - looked_ >= kLookInterval) {
    looked_ = now;
    const FileStamp before = file_;
    std::string said;
    if (FileStamp::Of(options_.tokens_path) != before) {
      if (const absl::Status status = Load(); status.ok()) {
        spdlog::info("read {} from {}", Counted(tokens_->size(), "token"), options_.tokens_path);
      } else {
        said = std::string(status.message());
        if (file_ != before || said != said_) {
          spdlog::error("the tokens stay as they were: {}", said);
        }
      }
    }
    said_ = said;
  }
  return tokens_;
}

int64_t Authenticator::Generation() {
  Tokens();
  std::lock_guard lock(mutex_);
  return generation_;
}

Principal Authenticator::Named(std::string name) const {
  const bool admin = admins_.count(name) > 0;
  return {std::move(name), admin};
}

absl::StatusOr<Principal> Authenticator::Identify(
    std::optional<std::string_view> authorization,
    std::optional<std::string_view> certificate_name) {
  if (!options_.enabled()) return Principal{"", true};
  const bool takes_tokens = !options_.tokens_path.empty() || !options_.token_entries.empty();
  if (takes_tokens && authorization) {
    constexpr std::string_view kScheme = "bearer ";
    if (authorization->size() > kMaxAuthorizationLength ||
        authorization->size() <= kScheme.size() ||
        strncasecmp(authorization->data(), kScheme.data(), kScheme.size()) != 0) {
      return Unauthenticated(
          "TOKEN_INVALID",
          "the authorization header is not \"Bearer TOKEN\"; send the token that "
          "the operator gave you, with no quotes or spaces");
    }
    if (auto name = Tokens()->Find(authorization->substr(kScheme.size()))) {
      return Named(*std::move(name));
    }
    return Unauthenticated("TOKEN_INVALID",
                           "the server does not know this token; it was mistyped or taken back: "
                           "ask the operator for a new one");
  }
  if (options_.client_certificates && certificate_name) {
    if (!CheckClientName(*certificate_name, "").ok()) {
      return Unauthenticated("CERTIFICATE_NAME_INVALID",
                             "the common name of the client's certificate is no client's name; "
                             "names have 1 to 64 letters, digits, '.', '_', '-' or '@'");
    }
    return Named(std::string(*certificate_name));
  }
  return Unauthenticated("TOKEN_MISSING",
                         "the server asks for a token; send it as \"authorization: Bearer TOKEN\" "
                         "(litags: --token-file FILE or LITAGS_TOKEN)");
}

}  // namespace litags
