// Who may speak to the gateway through a browser, and what browsers are told to refuse.
#ifndef LITAGS_SERVER_WEB_GUARD_H_
#define LITAGS_SERVER_WEB_GUARD_H_

#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "server/web/http.h"

namespace litags::web {

// OK unless a page of another site makes the browser send the request. Browsers say so in
// Sec-Fetch-Site or Origin; programs send neither. PERMISSION_DENIED (CROSS_SITE_REFUSED).
absl::Status CheckSite(const Head& head);

// OK if the request was sent to this machine by one of its own names. A site whose name is made to
// mean this machine (DNS rebinding) is the same site to browsers. PERMISSION_DENIED
// (HOST_NOT_LOCAL).
absl::Status CheckLocalHost(const Head& head);

// What the services get as the header "authorization": the request's own, or the cookie's token.
std::string AuthorizationOf(const Head& head);

// Set-Cookie of a session, for the port that the request was sent to. Scripts cannot read it, and
// other sites do not send it.
std::string SessionCookie(const Head& head, std::string_view token);
std::string NoSessionCookie(const Head& head);

// Whether a cookie can hold the text.
bool IsCookieValue(std::string_view text);

// Headers of every answer.
void AddSecurityHeaders(Answer* answer);

}  // namespace litags::web

#endif  // LITAGS_SERVER_WEB_GUARD_H_
