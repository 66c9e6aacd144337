#ifndef LITAGS_SERVER_WEB_TRANSCODE_H_
#define LITAGS_SERVER_WEB_TRANSCODE_H_

#include <google/protobuf/message.h>

#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/web/routes.h"

namespace litags::web {

using google::protobuf::Message;

// The messages of a route's RPC.
std::unique_ptr<Message> NewRequest(const Route& route);
std::unique_ptr<Message> NewResponse(const Route& route);

// The request that path, query and body make together, by Protobuf's JSON mapping; a field with two
// values is an error. INVALID_ARGUMENT (REQUEST_NOT_JSON, REQUEST_FIELD_INVALID).
absl::StatusOr<std::unique_ptr<Message>> RequestOf(const Match& match, const Head& head,
                                                   std::string_view body);

// Fills `message` with fields by name, as RequestOf() does with those of the query; the same
// errors.
using Fields = std::vector<std::pair<std::string, std::string>>;
absl::Status FillFields(const Fields& fields, Message* message);
// INVALID_ARGUMENT (REQUEST_FIELD_INVALID).
absl::Status FieldInvalid(std::string_view field, std::string_view why);

// By Protobuf's JSON mapping: names in lowerCamelCase, fields with default values left out.
absl::StatusOr<std::string> JsonOf(const Message& message);

}  // namespace litags::web

#endif  // LITAGS_SERVER_WEB_TRANSCODE_H_
