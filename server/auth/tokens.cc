#include "server/auth/tokens.h"

#include <fcntl.h>
#include <openssl/crypto.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <cstring>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "server/store/digest.h"

namespace litags {
namespace {

constexpr int kTokenBytes = 32;
constexpr size_t kMaxNameLength = 64;
constexpr size_t kDigestLength = 64;
constexpr std::string_view kDigestMark = ":sha256:";

// At the end of a file, whose last line may lack its newline, as some editors leave it. Returns
// errno: the file is then as it was, since half an entry would make all of it invalid.
int AppendLine(int fd, const std::string& text) {
  const off_t size = lseek(fd, 0, SEEK_END);
  char last = '\n';
  if (size < 0 || (size > 0 && pread(fd, &last, 1, size - 1) < 0)) return errno;
  const std::string line = absl::StrCat(last != '\n' ? "\n" : "", text, "\n");
  const ssize_t written = write(fd, line.data(), line.size());
  if (written == static_cast<ssize_t>(line.size()) && fsync(fd) == 0) return 0;
  const bool is_short = written >= 0 && written < static_cast<ssize_t>(line.size());
  const int error = is_short ? ENOSPC : errno;
  return ftruncate(fd, size) == 0 ? error : errno;
}

}  // namespace

std::string MakeToken() { return absl::StrCat("litags_", RandomHex(kTokenBytes)); }

std::string TokenEntry(std::string_view name, std::string_view token) {
  return std::string(name).append(kDigestMark).append(Sha256::Hex(token));
}

absl::Status CheckClientName(std::string_view name, std::string_view field) {
  const auto allowed = [](unsigned char c) {
    return std::isalnum(c) ||
           std::string_view("._-@").find(static_cast<char>(c)) != std::string_view::npos;
  };
  if (!name.empty() && name.size() <= kMaxNameLength &&
      std::all_of(name.begin(), name.end(), allowed)) {
    return absl::OkStatus();
  }
  return InvalidInput("CLIENT_NAME_INVALID", field,
                      absl::StrCat("a client's name has 1 to ", kMaxNameLength,
                                   " letters, digits, '.', '_', '-' or '@'; choose another name"));
}

absl::Status TokenTable::Add(std::string_view entry, std::string_view field) {
  const size_t mark = entry.find(kDigestMark);
  if (mark == std::string_view::npos || !IsDigest(entry.substr(mark + kDigestMark.size()))) {
    return InvalidInput(
        "TOKEN_ENTRY_INVALID", field,
        absl::StrCat(std::string(field),
                     ": not an entry of the form NAME:sha256:HEX with 64 lower-case "
                     "hex digits; make one with \"litags-server token NAME\""));
  }
  LITAGS_RETURN_IF_ERROR(CheckClientName(entry.substr(0, mark), field));
  entries_.push_back(
      {std::string(entry.substr(0, mark)), std::string(entry.substr(mark + kDigestMark.size()))});
  return absl::OkStatus();
}

absl::Status TokenTable::AddLines(std::string_view text, std::string_view field) {
  for (int number = 1; !text.empty(); ++number) {
    const size_t end = std::min(text.find('\n'), text.size());
    const std::string line(absl::StripAsciiWhitespace({text.data(), end}));
    text.remove_prefix(std::min(end + 1, text.size()));
    if (line.empty() || line.front() == '#') continue;
    LITAGS_RETURN_IF_ERROR(Add(line, absl::StrCat(std::string(field), " line ", number)));
  }
  return absl::OkStatus();
}

std::optional<std::string> TokenTable::Find(std::string_view token) const {
  const std::string digest = Sha256::Hex(token);
  const Entry* found = nullptr;
  for (const Entry& entry : entries_) {
    if (CRYPTO_memcmp(entry.sha256.data(), digest.data(), kDigestLength) == 0) found = &entry;
  }
  if (!found) return std::nullopt;
  return found->name;
}

absl::Status TokensUnreadable(const std::string& path, int error) {
  const std::string remedy =
      error == ENOENT
          ? absl::StrCat("make the file with \"litags-server token NAME --tokens ", path, "\"")
          : "give a file that the server's user may read";
  return MakeError(absl::StatusCode::kFailedPrecondition, "TOKENS_UNREADABLE", "--tokens",
                   absl::StrCat("cannot read tokens from ", path, ": ",
                                error != 0 ? std::strerror(error) : "it is no file, or too large",
                                "; ", remedy));
}

absl::StatusOr<std::string> AddTokenToFile(std::string_view name, const std::string& path) {
  LITAGS_RETURN_IF_ERROR(CheckClientName(name, "NAME"));
  const std::string token = MakeToken();
  const int fd = open(path.c_str(), O_RDWR | O_APPEND | O_CREAT | O_CLOEXEC, 0600);
  const int error = fd < 0 ? errno : AppendLine(fd, TokenEntry(name, token));
  if (fd >= 0) close(fd);
  if (error == 0) return token;
  return MakeError(absl::StatusCode::kFailedPrecondition, "TOKENS_NOT_WRITTEN", "--tokens",
                   absl::StrCat("cannot add a token to ", path, ": ", std::strerror(error),
                                "; check that the folder exists, has room and may be written"));
}

}  // namespace litags
