// Bearer tokens. Only their SHA-256 is kept: a token has 256 random bits, so a faster or slower
// digest would change nothing for someone who guesses.
#ifndef LITAGS_SERVER_AUTH_TOKENS_H_
#define LITAGS_SERVER_AUTH_TOKENS_H_

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace litags {

// "litags_" and 256 random bits as 64 hex digits.
std::string MakeToken();

// What the server keeps of a token: "NAME:sha256:HEX".
std::string TokenEntry(std::string_view name, std::string_view token);

// A client's name has 1 to 64 letters, digits, '.', '_', '-' or '@'. INVALID_ARGUMENT
// (CLIENT_NAME_INVALID).
absl::Status CheckClientName(std::string_view name, std::string_view field);

// Names by token. A name may have several tokens, so that one can be replaced without a gap.
class TokenTable {
 public:
  // Adds one entry. INVALID_ARGUMENT (TOKEN_ENTRY_INVALID), which never repeats the digest.
  absl::Status Add(std::string_view entry, std::string_view field);
  // One entry a line; empty lines and those that begin with '#' are skipped. The error names the
  // line.
  absl::Status AddLines(std::string_view text, std::string_view field);

  // Whose token it is. Takes as long for a wrong token as for a right one.
  std::optional<std::string> Find(std::string_view token) const;
  size_t size() const { return entries_.size(); }

 private:
  struct Entry {
    std::string name;
    std::string sha256;  // 64 lower-case hex digits
  };
  std::vector<Entry> entries_;
};

// Why a file of tokens cannot be read, by errno (0: it is no file, or too large), and what helps.
// FAILED_PRECONDITION (TOKENS_UNREADABLE).
absl::Status TokensUnreadable(const std::string& path, int error);

// Makes a token for `name` and appends its entry to the file, which is made, readable by its owner
// only, if it is not there. Returns the token, which is kept nowhere. FAILED_PRECONDITION
// (TOKENS_NOT_WRITTEN).
absl::StatusOr<std::string> AddTokenToFile(std::string_view name, const std::string& path);

}  // namespace litags

#endif  // LITAGS_SERVER_AUTH_TOKENS_H_
