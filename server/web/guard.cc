#include "server/web/guard.h"

#include <algorithm>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/core/utf8.h"
#include "server/auth/tls.h"

namespace litags::web {
namespace {

constexpr size_t kMaxCookieValue = 1024;

// Pictures of the app are made in the page (blob:). So is the worker in which its viewer sorts
// Gaussians: PlayCanvas has its text as a string, and the worker inherits this policy. All else
// comes from here.
constexpr char kPolicy[] =
    "default-src 'self'; img-src 'self' blob: data:; worker-src blob:; object-src 'none'; base-uri "
    "'none'; "
    "form-action 'self'; frame-ancestors 'none'";

bool SameHost(std::string_view origin, const Head& head) {
  const std::string_view scheme = head.tls ? "https://" : "http://";
  // A proxy that ends TLS passes on the browser's https.
  const std::string_view other = "https://";
  for (const std::string_view start : {scheme, other}) {
    if (origin.starts_with(start) && origin.substr(start.size()) == head.Header("host"))
      return true;
  }
  return false;
}

absl::Status Refused(std::string_view reason, std::string_view field, const std::string& message) {
  return MakeError(absl::StatusCode::kPermissionDenied, reason, field, message);
}

// What the header "host" says; the port is empty if there is none.
struct HostPort {
  std::string_view host, port;
};

HostPort SplitHost(std::string_view text) {
  const size_t colon = text.rfind(':');
  if (colon == std::string_view::npos) return {text, ""};
  const std::string_view port = text.substr(colon + 1);
  // "[::1]" has colons and no port.
  if (!std::all_of(port.begin(), port.end(), absl::ascii_isdigit)) return {text, ""};
  return {text.substr(0, colon), port};
}

// Browsers keep one cookie of a name for all ports of a host: the port is part of the name, so that
// two servers do not end each other's sessions.
std::string CookieName(const Head& head) {
  const std::string port(SplitHost(head.Header("host")).port);
  return absl::StrCat("litags_token", port.empty() ? "" : "_", port);
}

std::string Cookie(const Head& head, std::string_view value, std::string_view more) {
  return absl::StrCat(CookieName(head), "=", std::string(value),
                      "; Path=/; HttpOnly; SameSite=Strict", head.tls ? "; Secure" : "",
                      std::string(more));
}

}  // namespace

absl::Status CheckSite(const Head& head) {
  const std::string_view site = head.Header("sec-fetch-site");
  const std::string_view origin = head.Header("origin");
  const bool other_site = !site.empty() && site != "same-origin" && site != "none";
  const bool other_origin = !origin.empty() && !SameHost(origin, head);
  if (!other_site && !other_origin) return absl::OkStatus();
  return Refused("CROSS_SITE_REFUSED", other_origin ? "Origin" : "Sec-Fetch-Site",
                 absl::StrCat("a page of ", other_origin ? Utf8Prefix(origin, 200) : "another site",
                              " made the browser send this; open the server's own page"));
}

absl::Status CheckLocalHost(const Head& head) {
  const std::string_view host = head.Header("host");
  if (IsLoopbackHost(SplitHost(host).host)) return absl::OkStatus();
  return Refused("HOST_NOT_LOCAL", "Host",
                 absl::StrCat("\"", Utf8Prefix(host, 200),
                              "\" is no name of this machine for itself; use 127.0.0.1 or "
                              "localhost, or let the operator give the server tokens"));
}

std::string AuthorizationOf(const Head& head) {
  if (const auto header = head.Header("authorization"); !header.empty()) return std::string(header);
  const std::string_view token = CookieOf(head, CookieName(head));
  return token.empty() ? "" : absl::StrCat("Bearer ", std::string(token));
}

std::string SessionCookie(const Head& head, std::string_view token) {
  return Cookie(head, token, "");
}

std::string NoSessionCookie(const Head& head) { return Cookie(head, "", "; Max-Age=0"); }

bool IsCookieValue(std::string_view text) {
  return !text.empty() && text.size() <= kMaxCookieValue &&
         std::all_of(text.begin(), text.end(), [](unsigned char c) {
           return c > 0x20 && c < 0x7f && c != '"' && c != ',' && c != ';' && c != '\\';
         });
}

void AddSecurityHeaders(Answer* answer) {
  for (const auto& [name, value] :
       {std::pair{"X-Content-Type-Options", "nosniff"},
        std::pair{"Content-Security-Policy", kPolicy}, std::pair{"X-Frame-Options", "DENY"},
        std::pair{"Referrer-Policy", "no-referrer"},
        std::pair{"Cross-Origin-Resource-Policy", "same-origin"},
        std::pair{"Cross-Origin-Opener-Policy", "same-origin"}}) {
    answer->headers.emplace_back(name, value);
  }
}

}  // namespace litags::web
