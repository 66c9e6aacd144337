#ifndef LITAGS_SERVER_WEB_HTTP_H_
#define LITAGS_SERVER_WEB_HTTP_H_

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace litags::web {

// What comes before the body of a request.
struct Head {
  std::string method;  // "GET"
  std::string path;    // as it came: percent-encoded, without the query
  std::vector<std::pair<std::string, std::string>> query;  // decoded
  std::map<std::string, std::string> headers;              // by name in lower case
  std::optional<int64_t> content_length;
  bool tls = false;
  std::string peer;        // for logs
  std::string network;     // who it is for limits
  std::string request_id;  // of its calls, and of its answer

  // Empty if there is none.
  std::string_view Header(std::string_view name) const;
  std::string_view Query(std::string_view name) const;
};

// An answer that is whole.
struct Answer {
  int code = 200;
  std::string type;  // of the body, as "application/json"
  std::string body;
  std::vector<std::pair<std::string, std::string>> headers;
};

// Takes "/a%20b?x=1&y=%2B" apart into path and query. False if it is no path or has a bad percent
// sign in its query.
bool ParseTarget(std::string_view target, Head* head);

// "a%20b" as "a b"; nullopt if a percent sign is not followed by two hexadecimal digits.
std::optional<std::string> PercentDecode(std::string_view text);

// The value of a cookie; empty if there is none.
std::string_view CookieOf(const Head& head, std::string_view name);

// The value of Content-Disposition that saves a file of "jobs/ID" as ID with this ending.
std::string AttachmentOf(std::string_view job, std::string_view ending);

// "Not Found" of 404.
std::string_view ReasonPhrase(int code);

// Status line and headers, up to the empty line. Without `length` the body comes in chunks, or ends
// with the connection. Characters that end a line are left out of values.
std::string HeadText(const Answer& answer, std::optional<int64_t> length, bool chunked,
                     bool keep_alive);

}  // namespace litags::web

#endif  // LITAGS_SERVER_WEB_HTTP_H_
