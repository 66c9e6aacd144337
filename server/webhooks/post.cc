#include "server/webhooks/post.h"

#include <curl/curl.h>

#include <memory>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "server/webhooks/public_address.h"

namespace litags {
namespace {

absl::Status Failed(const std::string& why) {
  return MakeError(absl::StatusCode::kUnavailable, "WEBHOOK_FAILED", "webhook.url", why);
}

struct Guard {
  bool (*may_reach)(const sockaddr*) = nullptr;  // null: all
  bool refused = false;
};

curl_socket_t OpenSocket(void* data, curlsocktype, curl_sockaddr* address) {
  auto* guard = static_cast<Guard*>(data);
  if (guard->may_reach && !guard->may_reach(&address->addr)) {
    guard->refused = true;
    return CURL_SOCKET_BAD;
  }
  return socket(address->family, address->socktype | SOCK_CLOEXEC, address->protocol);
}

// The answer's body is of no use: the first piece of it ends the exchange.
size_t Ignore(char*, size_t, size_t, void*) { return 0; }

}  // namespace

absl::Status Post(const std::string& url, const std::string& body,
                  const std::vector<std::pair<std::string, std::string>>& headers,
                  const PostOptions& options) {
  static const CURLcode initialized = curl_global_init(CURL_GLOBAL_DEFAULT);
  const std::unique_ptr<CURL, decltype(&curl_easy_cleanup)> curl(
      initialized == CURLE_OK ? curl_easy_init() : nullptr, curl_easy_cleanup);
  if (!curl) return Failed("libcurl does not start");
  curl_slist* list = nullptr;
  for (const auto& [name, value] : headers) {
    list = curl_slist_append(list, absl::StrCat(name, ": ", value).c_str());
  }
  list = curl_slist_append(list, "Expect:");  // waits for nobody's leave
  const std::unique_ptr<curl_slist, decltype(&curl_slist_free_all)> headers_owner(
      list, curl_slist_free_all);
  Guard guard{options.may_reach || options.internal ? options.may_reach : IsPublicAddress};
  char why[CURL_ERROR_SIZE] = "";
  const auto set = [&](CURLoption option, auto value) {
    curl_easy_setopt(curl.get(), option, value);
  };
  set(CURLOPT_URL, url.c_str());
  set(CURLOPT_PROTOCOLS_STR, options.internal ? "https,http" : "https");
  set(CURLOPT_FOLLOWLOCATION, 0L);
  set(CURLOPT_PROXY, "");
  set(CURLOPT_NETRC, long{CURL_NETRC_IGNORED});
  set(CURLOPT_NOSIGNAL, 1L);
  set(CURLOPT_TIMEOUT_MS, static_cast<long>(1000 * options.timeout_seconds));
  set(CURLOPT_OPENSOCKETFUNCTION, OpenSocket);
  set(CURLOPT_OPENSOCKETDATA, &guard);
  set(CURLOPT_HTTPHEADER, list);
  set(CURLOPT_USERAGENT, "litags");
  set(CURLOPT_POSTFIELDS, body.c_str());
  set(CURLOPT_POSTFIELDSIZE, static_cast<long>(body.size()));
  set(CURLOPT_WRITEFUNCTION, Ignore);
  set(CURLOPT_ERRORBUFFER, why);
  if (!options.ca_path.empty()) set(CURLOPT_CAINFO, options.ca_path.c_str());
  const CURLcode code = curl_easy_perform(curl.get());
  long status = 0;
  curl_easy_getinfo(curl.get(), CURLINFO_RESPONSE_CODE, &status);
  if (status >= 200 && status < 300) return absl::OkStatus();
  if (status > 0) return Failed(absl::StrCat("the host answered with status ", status));
  if (guard.refused) return Failed("the host has no address of the internet");
  const std::string reason = why[0] ? why : curl_easy_strerror(code);
  if (code != CURLE_PEER_FAILED_VERIFICATION) return Failed(reason);
  return Failed(absl::StrCat("the host's certificate is not trusted (", reason,
                             "); --webhook-ca of litags-server names its authority"));
}

}  // namespace litags
