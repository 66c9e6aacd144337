// Pages of lists.
#ifndef LITAGS_SERVER_API_LIST_PAGE_H_
#define LITAGS_SERVER_API_LIST_PAGE_H_

#include <cstddef>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace litags {

// How many entries a page may have, and how many bytes: gRPC's clients take messages of 4 MiB.
class PageRoom {
 public:
  // `asked` by the client: 0 is `usual`, more than `most` is `most`. INVALID_ARGUMENT
  // (PAGE_SIZE_INVALID) if it is negative.
  static absl::StatusOr<PageRoom> Make(int asked, int usual, int most);

  int size() const { return size_; }
  // Whether an entry of so many bytes is on the page: one at least is. Not asked again after a no.
  bool Takes(size_t bytes);

 private:
  explicit PageRoom(int size) : size_(size) {}

  int size_, entries_ = 0;
  size_t bytes_ = 0;
};

// INVALID_ARGUMENT (PAGE_TOKEN_INVALID).
absl::Status BadPageToken(std::string_view method);

}  // namespace litags

#endif  // LITAGS_SERVER_API_LIST_PAGE_H_
