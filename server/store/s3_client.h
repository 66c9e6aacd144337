// The S3 protocol as far as a blob store needs it: signed requests, tried again. Internal to
// server/store.
#ifndef LITAGS_SERVER_STORE_S3_CLIENT_H_
#define LITAGS_SERVER_STORE_S3_CLIENT_H_

#include <map>
#include <mutex>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/store/blob_store.h"

namespace litags {

struct S3Request {
  const char* method = "GET";
  std::string key;  // empty: the bucket itself
  // In the order of their names, as they are signed; values are encoded here.
  std::vector<std::pair<std::string, std::string>> query;
  std::vector<std::string> headers;  // "name: value"
  std::string_view body;
};

struct S3Answer {
  std::string body;
  std::map<std::string, std::string> headers;  // names in lower case
};

// Thread-safe.
class S3Client {
 public:
  explicit S3Client(S3Options options) : options_(std::move(options)) {}
  ~S3Client();

  // Sends the request, again after failures that may pass: kTries times, with growing pauses, while
  // options().patience_seconds last.
  // NOT_FOUND (BLOB_NOT_FOUND); FAILED_PRECONDITION (BLOBS_DENIED); UNAVAILABLE
  // (BLOBS_UNAVAILABLE); INTERNAL (STORE_FAILED).
  absl::StatusOr<S3Answer> Send(const S3Request& request);

  const S3Options& options() const { return options_; }

 private:
  static constexpr int kTries = 6;
  struct Exchange;

  // One try, given up after so long without a byte. `may_pass`: whether another one may do better.
  absl::StatusOr<S3Answer> SendOnce(const S3Request& request, double patience_seconds,
                                    bool* may_pass);
  std::string UrlOf(const S3Request& request) const;
  void* TakeHandle();
  void PutHandle(void* handle);

  const S3Options options_;
  std::mutex mutex_;
  std::vector<void*> handles_;  // CURL*, idle, with their connections
};

// The text of the first element `name` of an XML document, and of all of them.
std::string XmlText(std::string_view xml, std::string_view name);
std::vector<std::string> XmlTexts(std::string_view xml, std::string_view name);

}  // namespace litags

#endif  // LITAGS_SERVER_STORE_S3_CLIENT_H_
