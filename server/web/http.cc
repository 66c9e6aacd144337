#include "server/web/http.h"

#include <algorithm>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"

namespace litags::web {
namespace {

int HexDigit(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

// A plus sign is a space in queries, and only there.
std::optional<std::string> QueryDecode(std::string_view text) {
  std::string spaced(text);
  std::replace(spaced.begin(), spaced.end(), '+', ' ');
  return PercentDecode(spaced);
}

bool ParseQuery(std::string_view query, Head* head) {
  while (!query.empty()) {
    const std::string_view part = query.substr(0, query.find('&'));
    query.remove_prefix(std::min(query.size(), part.size() + 1));
    if (part.empty()) continue;
    const size_t equals = std::min(part.find('='), part.size());
    const auto name = QueryDecode(part.substr(0, equals));
    const auto value = QueryDecode(part.substr(std::min(part.size(), equals + 1)));
    if (!name || !value) return false;
    head->query.emplace_back(*name, *value);
  }
  return true;
}

std::string_view Trim(std::string_view text) {
  while (!text.empty() && text.front() == ' ') text.remove_prefix(1);
  while (!text.empty() && text.back() == ' ') text.remove_suffix(1);
  return text;
}

void AppendHeader(std::string_view name, std::string_view value, std::string* text) {
  absl::StrAppend(text, std::string(name), ": ");
  std::copy_if(value.begin(), value.end(), std::back_inserter(*text),
               [](unsigned char c) { return c >= 0x20 && c != 0x7f; });
  text->append("\r\n");
}

}  // namespace

std::string_view Head::Header(std::string_view name) const {
  const auto found = headers.find(std::string(name));
  return found == headers.end() ? std::string_view() : std::string_view(found->second);
}

std::string_view Head::Query(std::string_view name) const {
  const auto found = std::find_if(query.begin(), query.end(),
                                  [&](const auto& part) { return part.first == name; });
  return found == query.end() ? std::string_view() : std::string_view(found->second);
}

bool ParseTarget(std::string_view target, Head* head) {
  if (target.empty() || target.front() != '/') return false;
  const size_t question = std::min(target.find('?'), target.size());
  head->path = target.substr(0, question);
  return ParseQuery(target.substr(std::min(target.size(), question + 1)), head);
}

std::optional<std::string> PercentDecode(std::string_view text) {
  std::string decoded;
  for (size_t i = 0; i < text.size(); ++i) {
    if (text[i] != '%') {
      decoded.push_back(text[i]);
      continue;
    }
    if (i + 2 >= text.size()) return std::nullopt;
    const int high = HexDigit(text[i + 1]), low = HexDigit(text[i + 2]);
    if (high < 0 || low < 0) return std::nullopt;
    decoded.push_back(static_cast<char>(16 * high + low));
    i += 2;
  }
  return decoded;
}

std::string_view CookieOf(const Head& head, std::string_view name) {
  std::string_view all = head.Header("cookie");
  while (!all.empty()) {
    const std::string_view part = all.substr(0, all.find(';'));
    all.remove_prefix(std::min(all.size(), part.size() + 1));
    const size_t equals = part.find('=');
    if (equals == std::string_view::npos) continue;
    if (Trim(part.substr(0, equals)) == name) return Trim(part.substr(equals + 1));
  }
  return {};
}

std::string AttachmentOf(std::string_view job, std::string_view ending) {
  std::string id(job.substr(job.rfind('/') + 1));
  std::erase_if(id, [](char c) { return !absl::ascii_isalnum(static_cast<unsigned char>(c)); });
  return absl::StrCat("attachment; filename=\"", id,
                      absl::string_view(ending.data(), ending.size()), "\"");
}

std::string_view ReasonPhrase(int code) {
  static const std::map<int, std::string_view> kPhrases = {{200, "OK"},
                                                           {202, "Accepted"},
                                                           {204, "No Content"},
                                                           {304, "Not Modified"},
                                                           {400, "Bad Request"},
                                                           {401, "Unauthorized"},
                                                           {403, "Forbidden"},
                                                           {404, "Not Found"},
                                                           {405, "Method Not Allowed"},
                                                           {409, "Conflict"},
                                                           {411, "Length Required"},
                                                           {413, "Content Too Large"},
                                                           {415, "Unsupported Media Type"},
                                                           {429, "Too Many Requests"},
                                                           {431, "Request Header Fields Too Large"},
                                                           {499, "Client Closed Request"},
                                                           {500, "Internal Server Error"},
                                                           {501, "Not Implemented"},
                                                           {503, "Service Unavailable"},
                                                           {504, "Gateway Timeout"}};
  const auto found = kPhrases.find(code);
  return found == kPhrases.end() ? "Unknown" : found->second;
}

std::string HeadText(const Answer& answer, std::optional<int64_t> length, bool chunked,
                     bool keep_alive) {
  std::string text =
      absl::StrCat("HTTP/1.1 ", answer.code, " ", std::string(ReasonPhrase(answer.code)), "\r\n");
  if (!answer.type.empty()) AppendHeader("Content-Type", answer.type, &text);
  for (const auto& [name, value] : answer.headers) AppendHeader(name, value, &text);
  const bool has_body = answer.code != 204 && answer.code != 304;
  if (has_body && length) AppendHeader("Content-Length", absl::StrCat(*length), &text);
  if (chunked) AppendHeader("Transfer-Encoding", "chunked", &text);
  AppendHeader("Connection", keep_alive ? "keep-alive" : "close", &text);
  text.append("\r\n");
  return text;
}

}  // namespace litags::web
