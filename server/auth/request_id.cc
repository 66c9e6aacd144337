#include "server/auth/request_id.h"

#include <algorithm>

#include "absl/strings/ascii.h"
#include "server/store/digest.h"

namespace litags {

constexpr size_t kMaxLength = 64;

std::string RequestIdOf(std::string_view wanted) {
  const bool good = !wanted.empty() && wanted.size() <= kMaxLength &&
                    std::all_of(wanted.begin(), wanted.end(), [](unsigned char c) {
                      return absl::ascii_isalnum(c) || c == '.' || c == '_' || c == '-';
                    });
  return good ? std::string(wanted) : RandomHex(8);
}

}  // namespace litags
