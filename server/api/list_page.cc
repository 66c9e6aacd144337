#include "server/api/list_page.h"

#include <algorithm>
#include <string>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"

namespace litags {
namespace {

constexpr size_t kMaxPageBytes = 2 << 20;

}  // namespace

absl::StatusOr<PageRoom> PageRoom::Make(int asked, int usual, int most) {
  if (asked >= 0) return PageRoom(asked == 0 ? usual : std::min(asked, most));
  return InvalidInput(
      "PAGE_SIZE_INVALID", "page_size",
      absl::StrCat("page_size is ", asked, "; give how many a page may have, or 0 for ", usual));
}

bool PageRoom::Takes(size_t bytes) {
  bytes_ += bytes;
  if (entries_ > 0 && (entries_ == size_ || bytes_ > kMaxPageBytes)) return false;
  ++entries_;
  return true;
}

absl::Status BadPageToken(std::string_view method) {
  return InvalidInput("PAGE_TOKEN_INVALID", "page_token",
                      absl::StrCat("page_token is not one that ", std::string(method),
                                   " returned for this request; start with an empty one"));
}

}  // namespace litags
