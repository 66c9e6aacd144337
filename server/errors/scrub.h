// What clients are told of the server's inside: nothing of where things lie. The log says all.
#ifndef LITAGS_SERVER_ERRORS_SCRUB_H_
#define LITAGS_SERVER_ERRORS_SCRUB_H_

#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "engine/core/error.h"

namespace litags {

// The text with the last name alone of each path from the root: "0012.jpg" of
// "/srv/litags/scratch/7/input/photos/0012.jpg".
std::string WithoutPaths(std::string_view text);

// What a client reads as the message of `status`: without paths, and of a store that is away or
// damaged only so much, without addresses and what its library says.
std::string MessageForClients(const absl::Status& status);

// The reason, or the code's name, and the field of the request. What is wrong with a store, as
// "blobs", is no field of any.
ErrorDetail DetailForClients(const absl::Status& status);

}  // namespace litags

#endif  // LITAGS_SERVER_ERRORS_SCRUB_H_
