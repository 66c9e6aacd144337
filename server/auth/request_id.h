// The number that a request has in the log, and that its answer tells.
#ifndef LITAGS_SERVER_AUTH_REQUEST_ID_H_
#define LITAGS_SERVER_AUTH_REQUEST_ID_H_

#include <string>
#include <string_view>

namespace litags {

// The header that requests and answers have it in.
inline constexpr char kRequestIdHeader[] = "x-request-id";

// `wanted`, if it is up to 64 letters, digits, '.', '_' or '-', else a new one.
std::string RequestIdOf(std::string_view wanted);

}  // namespace litags

#endif  // LITAGS_SERVER_AUTH_REQUEST_ID_H_
