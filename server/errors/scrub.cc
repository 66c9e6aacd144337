#include "server/errors/scrub.h"

#include <algorithm>
#include <iterator>

#include "engine/core/error.h"

namespace litags {
namespace {

struct Plain {
  std::string_view reason, message;
};

constexpr Plain kStoreMessages[] = {
    {"STORE_UNAVAILABLE", "the job store is away; nothing was changed, try again in a moment"},
    {"STORE_BUSY", "the job store is busy; nothing was changed, try again in a moment"},
    {"STORE_OUTCOME_UNKNOWN",
     "the job store went away while it wrote; look whether the change was made, then try again"},
    {"STORE_FAILED", "the server's store failed; its log says why, please tell the operator"},
    {"STORE_CORRUPT",
     "what the server stores is damaged; its log says where, please tell the operator"},
    {"BLOBS_UNAVAILABLE", "the blob store is away; try again in a moment"},
    {"BLOBS_DENIED", "the blob store refuses the server; please tell the operator"},
    {"STORE_NOT_OPENED", "the job store refuses the server; please tell the operator"},
};

// What is told of an error of a store; null of others.
const Plain* OfStore(const absl::Status& status) {
  const auto detail = GetErrorDetail(status);
  const auto* found =
      std::find_if(std::begin(kStoreMessages), std::end(kStoreMessages),
                   [&](const Plain& plain) { return detail && detail->reason == plain.reason; });
  return found == std::end(kStoreMessages) ? nullptr : found;
}

// Paths begin a word, or stand in quotes or brackets. In "images[/a/b.jpg]" the name is the
// client's own.
bool MayPrecedePath(char c) {
  return std::string_view(" \t\n\"'`(<=").find(c) != std::string_view::npos;
}

bool EndsPath(char c) {
  return std::string_view(" \t\n\"'`()<>,;:").find(c) != std::string_view::npos;
}

}  // namespace

std::string WithoutPaths(std::string_view text) {
  std::string result;
  for (size_t i = 0; i < text.size();) {
    if (text[i] != '/' || (i > 0 && !MayPrecedePath(text[i - 1]))) {
      result.push_back(text[i++]);
      continue;
    }
    const auto end =
        std::find_if(text.begin() + static_cast<std::ptrdiff_t>(i), text.end(), EndsPath) -
        text.begin();
    const std::string_view path = text.substr(i, static_cast<size_t>(end) - i);
    const size_t last = path.size() < 2 ? 0 : path.find_last_of('/', path.size() - 2);
    result.append(last == 0 ? path : path.substr(last + 1));
    i = static_cast<size_t>(end);
  }
  return result;
}

std::string MessageForClients(const absl::Status& status) {
  if (const Plain* plain = OfStore(status)) return std::string(plain->message);
  // What is wrong with an input is said in the client's own words, as of a file in an archive.
  if (absl::IsInvalidArgument(status)) return std::string(status.message());
  return WithoutPaths(std::string(status.message()));
}

ErrorDetail DetailForClients(const absl::Status& status) {
  ErrorDetail detail =
      GetErrorDetail(status).value_or(ErrorDetail{absl::StatusCodeToString(status.code()), ""});
  if (OfStore(status) != nullptr) detail.field.clear();
  return detail;
}

}  // namespace litags
