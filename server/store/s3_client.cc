#include "server/store/s3_client.h"

#include <curl/curl.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>
#include <random>
#include <thread>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "engine/core/error.h"
#include "server/store/digest.h"

namespace litags {
namespace {

constexpr long kConnectSeconds = 5;
constexpr double kStalledSeconds = 20;  // without a byte
constexpr int kFirstPauseMs = 100;      // doubles, with jitter
constexpr size_t kMaxErrorBytes = 64 << 10;

void PauseBefore(int attempt) {
  thread_local std::mt19937 random{std::random_device{}()};
  const int longest = kFirstPauseMs << attempt;
  std::this_thread::sleep_for(std::chrono::milliseconds(longest / 2 + random() % longest / 2));
}

std::string Encoded(const std::string& text) {
  char* encoded = curl_easy_escape(nullptr, text.data(), static_cast<int>(text.size()));
  std::string result = encoded ? encoded : "";
  curl_free(encoded);
  return result;
}

absl::Status Unavailable(const std::string& why) {
  return MakeError(absl::StatusCode::kUnavailable, "BLOBS_UNAVAILABLE", "",
                   absl::StrCat("the blob store is away: ", why, "; try again in a moment"));
}

absl::Status StatusOfCode(long code, const S3Request& request, const std::string& body) {
  const std::string reason = XmlText(body, "Code");
  if (code == 404 && reason != "NoSuchBucket") {
    return MakeError(absl::StatusCode::kNotFound, "BLOB_NOT_FOUND", "",
                     absl::StrCat("no stored file ", request.key));
  }
  const std::string what =
      absl::StrCat("the blob store answered ", request.method, " ", request.key, " with ", code,
                   " ", reason, " ", XmlText(body, "Message"));
  // 400: to HEAD there is no word why; most often it is the token. Others say it.
  const bool refused_400 = request.method == std::string_view("HEAD") || reason == "ExpiredToken" ||
                           reason == "TokenRefreshRequired" || reason == "InvalidToken" ||
                           reason == "RequestTimeTooSkewed";
  if (code == 401 || code == 403 || code == 404 || (code == 400 && refused_400)) {
    return MakeError(
        absl::StatusCode::kFailedPrecondition, "BLOBS_DENIED", "blobs",
        absl::StrCat(what, "; check the bucket, its policy, the AWS_* variables and the clock"));
  }
  if (code == 429 || code >= 500 || reason == "RequestTimeout") return Unavailable(what);
  return MakeError(absl::StatusCode::kInternal, "STORE_FAILED", "", what);
}

}  // namespace

// What libcurl's callbacks fill.
struct S3Client::Exchange {
  CURL* const curl;
  S3Answer answer;

  bool IsOk() const {
    long code = 0;
    curl_easy_getinfo(curl, CURLINFO_RESPONSE_CODE, &code);
    return code >= 200 && code < 300;
  }

  static size_t OnBody(char* data, size_t, size_t size, void* self) {
    auto& exchange = *static_cast<Exchange*>(self);
    if (exchange.IsOk() || exchange.answer.body.size() < kMaxErrorBytes) {
      exchange.answer.body.append(data, size);
    }
    return size;
  }

  static size_t OnHeader(char* data, size_t, size_t size, void* self) {
    const std::string line(data, size);
    const size_t colon = line.find(':');
    if (colon != std::string::npos) {
      static_cast<Exchange*>(self)->answer.headers[absl::AsciiStrToLower(line.substr(0, colon))] =
          std::string(absl::StripAsciiWhitespace(line.substr(colon + 1)));
    }
    return size;
  }
};

S3Client::~S3Client() {
  for (void* handle : handles_) curl_easy_cleanup(handle);
}

void* S3Client::TakeHandle() {
  static const CURLcode initialized = curl_global_init(CURL_GLOBAL_DEFAULT);
  std::lock_guard lock(mutex_);
  if (initialized != CURLE_OK) return nullptr;
  if (handles_.empty()) return curl_easy_init();
  void* handle = handles_.back();
  handles_.pop_back();
  curl_easy_reset(handle);
  return handle;
}

void S3Client::PutHandle(void* handle) {
  std::lock_guard lock(mutex_);
  handles_.push_back(handle);
}

std::string S3Client::UrlOf(const S3Request& request) const {
  std::string url = absl::StrCat(options_.endpoint, "/", options_.bucket);
  if (!request.key.empty()) absl::StrAppend(&url, "/", options_.prefix, request.key);
  char separator = '?';
  for (const auto& [name, value] : request.query) {
    absl::StrAppend(&url, std::string(1, separator), name, "=", Encoded(value));
    separator = '&';
  }
  return url;
}

absl::StatusOr<S3Answer> S3Client::SendOnce(const S3Request& request, double patience_seconds,
                                            bool* may_pass) {
  *may_pass = false;
  CURL* const curl = TakeHandle();
  if (!curl) return Unavailable("libcurl cannot be used");
  const std::unique_ptr<void, std::function<void(void*)>> keep(
      curl, [this](void* handle) { PutHandle(handle); });
  Exchange exchange{curl, {}};
  curl_slist* list = nullptr;
  const auto add_header = [&list](const std::string& header) {
    list = curl_slist_append(list, header.c_str());
  };
  for (const std::string& header : request.headers) add_header(header);
  // Signed, so that what arrives is what was sent.
  add_header("x-amz-content-sha256: " + Sha256::Hex(request.body));
  if (!options_.session_token.empty()) {
    add_header("x-amz-security-token: " + options_.session_token);
  }
  const std::unique_ptr<curl_slist, decltype(&curl_slist_free_all)> headers(list,
                                                                            curl_slist_free_all);
  const std::string url = UrlOf(request);
  const std::string scope = absl::StrCat("aws:amz:", options_.region, ":s3");
  curl_easy_setopt(curl, CURLOPT_URL, url.c_str());
  curl_easy_setopt(curl, CURLOPT_PROTOCOLS_STR, "http,https");
  curl_easy_setopt(curl, CURLOPT_NOSIGNAL, 1L);
  curl_easy_setopt(curl, CURLOPT_CONNECTTIMEOUT, kConnectSeconds);
  curl_easy_setopt(curl, CURLOPT_LOW_SPEED_LIMIT, 1L);
  // 0 would be no limit.
  curl_easy_setopt(curl, CURLOPT_LOW_SPEED_TIME, static_cast<long>(std::ceil(patience_seconds)));
  curl_easy_setopt(curl, CURLOPT_USERNAME, options_.access_key.c_str());  // may hold a colon
  curl_easy_setopt(curl, CURLOPT_PASSWORD, options_.secret_key.c_str());
  curl_easy_setopt(curl, CURLOPT_AWS_SIGV4, scope.c_str());
  const std::string_view method = request.method;
  if (method == "PUT" || method == "POST") {
    curl_easy_setopt(curl, CURLOPT_POST, 1L);
    curl_easy_setopt(curl, CURLOPT_POSTFIELDSIZE_LARGE,
                     static_cast<curl_off_t>(request.body.size()));
    curl_easy_setopt(curl, CURLOPT_POSTFIELDS, request.body.data() ? request.body.data() : "");
  }
  if (method == "HEAD") curl_easy_setopt(curl, CURLOPT_NOBODY, 1L);
  curl_easy_setopt(curl, CURLOPT_CUSTOMREQUEST, request.method);
  curl_easy_setopt(curl, CURLOPT_HTTPHEADER, headers.get());
  curl_easy_setopt(curl, CURLOPT_WRITEFUNCTION, Exchange::OnBody);
  curl_easy_setopt(curl, CURLOPT_WRITEDATA, &exchange);
  curl_easy_setopt(curl, CURLOPT_HEADERFUNCTION, Exchange::OnHeader);
  curl_easy_setopt(curl, CURLOPT_HEADERDATA, &exchange);

  const CURLcode result = curl_easy_perform(curl);
  if (result != CURLE_OK) {
    *may_pass = true;
    return Unavailable(curl_easy_strerror(result));
  }
  if (exchange.IsOk()) return std::move(exchange.answer);
  long code = 0;
  curl_easy_getinfo(curl, CURLINFO_RESPONSE_CODE, &code);
  const absl::Status status = StatusOfCode(code, request, exchange.answer.body);
  *may_pass = absl::IsUnavailable(status);
  return status;
}

absl::StatusOr<S3Answer> S3Client::Send(const S3Request& request) {
  using SteadyClock = std::chrono::steady_clock;
  const auto start = SteadyClock::now();
  double left = options_.patience_seconds;
  for (int attempt = 1;; ++attempt) {
    bool may_pass = false;
    auto answer = SendOnce(request, std::min(left, kStalledSeconds), &may_pass);
    if (answer.ok() || !may_pass || attempt == kTries) return answer;
    PauseBefore(attempt);
    const std::chrono::duration<double> spent = SteadyClock::now() - start;
    left = options_.patience_seconds - spent.count();
    if (left <= 0) return answer;
  }
}

std::vector<std::string> XmlTexts(std::string_view xml, std::string_view name) {
  const std::string open = absl::StrCat("<", std::string(name), ">");
  const std::string close = absl::StrCat("</", std::string(name), ">");
  std::vector<std::string> texts;
  for (size_t at = xml.find(open); at != std::string_view::npos; at = xml.find(open, at)) {
    at += open.size();
    const size_t end = xml.find(close, at);
    if (end == std::string_view::npos) break;
    texts.push_back(absl::StrReplaceAll(
        std::string(xml.substr(at, end - at)),
        {{"&quot;", "\""}, {"&#34;", "\""}, {"&lt;", "<"}, {"&gt;", ">"}, {"&amp;", "&"}}));
  }
  return texts;
}

std::string XmlText(std::string_view xml, std::string_view name) {
  std::vector<std::string> texts = XmlTexts(xml, name);
  return texts.empty() ? std::string() : std::move(texts.front());
}

}  // namespace litags
