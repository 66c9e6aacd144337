#include "server/web/transcode.h"

#include <google/protobuf/descriptor.h>
#include <google/protobuf/util/json_util.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "engine/core/check.h"
#include "engine/core/error.h"
#include "engine/core/json_text.h"
#include "engine/core/utf8.h"

namespace litags::web {
namespace {

using google::protobuf::Descriptor;
using google::protobuf::FieldDescriptor;
using nlohmann::json;

// Requests nest three deep; a parser's stack ends somewhere.
constexpr int kMaxDepth = 32;
constexpr size_t kMaxShown = 100;  // bytes of a stranger's text in a message

const google::protobuf::MethodDescriptor& MethodOf(const Route& route) {
  std::string name = absl::StrCat("litags.v1.", std::string(route.rpc));
  std::replace(name.begin(), name.end(), '/', '.');
  const auto* method = google::protobuf::DescriptorPool::generated_pool()->FindMethodByName(name);
  LITAGS_CHECK(method != nullptr);
  return *method;
}

std::unique_ptr<Message> New(const Descriptor* descriptor) {
  return std::unique_ptr<Message>(
      google::protobuf::MessageFactory::generated_factory()->GetPrototype(descriptor)->New());
}

// Brackets that are open at one time, at most; those inside texts do not count.
int Depth(std::string_view text) {
  int depth = 0, deepest = 0;
  bool quoted = false;
  for (size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (quoted && c == '\\') {
      ++i;
    } else if (c == '"') {
      quoted = !quoted;
    } else if (!quoted && (c == '{' || c == '[')) {
      deepest = std::max(deepest, ++depth);
    } else if (!quoted && (c == '}' || c == ']')) {
      --depth;
    }
  }
  return deepest;
}

absl::StatusOr<json> ParseBody(std::string_view body) {
  if (body.find_first_not_of(" \t\r\n") == std::string_view::npos) return json::object();
  json parsed;
  if (Depth(body) <= kMaxDepth) parsed = ParseJson(body);
  if (!parsed.is_object()) {
    return InvalidInput("REQUEST_NOT_JSON", "body",
                        absl::StrCat("the body is not a JSON object nested at most ", kMaxDepth,
                                     " deep; send the request's fields as one"));
  }
  return parsed;
}

const FieldDescriptor* FieldOf(const Descriptor* message, const std::string& name) {
  const FieldDescriptor* field = message->FindFieldByCamelcaseName(name);
  return field ? field : message->FindFieldByName(name);
}

// Puts a text at "settings.width" of `object`, which is a `message` as JSON.
absl::Status Put(const Descriptor* message, const std::string& path, const std::string& value,
                 json* object) {
  const std::string name = path.substr(0, path.find('.'));
  const FieldDescriptor* field = FieldOf(message, name);
  if (!field) return FieldInvalid(path, "the request has no such field");
  // One name for a field, so that a second value is seen.
  const std::string key = field->json_name();
  if (object->contains(field->name()) && key != field->name()) {
    return FieldInvalid(path, "it is there twice; send it once");
  }
  if (name.size() < path.size()) {
    json& inner = (*object)[key];
    if (inner.is_null()) inner = json::object();
    if (!field->message_type() || field->is_repeated() || !inner.is_object()) {
      return FieldInvalid(path, "it has no fields inside; send it in the body");
    }
    return Put(field->message_type(), path.substr(name.size() + 1), value, &inner);
  }
  if (field->is_repeated()) {
    json& list = (*object)[key];
    if (list.is_null()) list = json::array();
    if (!list.is_array()) return FieldInvalid(path, "it is no list in the body");
    list.push_back(value);
    return absl::OkStatus();
  }
  json& there = (*object)[key];
  if (there.is_null()) there = value;
  return there == value ? absl::OkStatus() : FieldInvalid(path, "it is there twice; send it once");
}

// What the body is: the whole request, one field of it, or nothing.
absl::StatusOr<json> FromBody(const Route& route, std::string_view body) {
  if (route.body.empty()) return json::object();
  auto parsed = ParseBody(body);
  if (!parsed.ok() || route.body == "*") return parsed;
  json request = json::object();
  request[std::string(route.body)] = *std::move(parsed);
  return request;
}

absl::Status PutAll(const Fields& values, const Descriptor* message, json* object) {
  for (const auto& [path, value] : values) {
    LITAGS_RETURN_IF_ERROR(Put(message, path, value, object));
  }
  return absl::OkStatus();
}

absl::Status Parse(const json& fields, Message* message) {
  std::string text;
  try {
    text = fields.dump();
  } catch (const json::exception&) {
    return InvalidInput("REQUEST_NOT_JSON", "query",
                        "path or query hold a text that is not UTF-8; encode it as such");
  }
  const auto parsed = google::protobuf::util::JsonStringToMessage(text, message);
  if (parsed.ok()) return absl::OkStatus();
  return InvalidInput(
      "REQUEST_FIELD_INVALID", "",
      absl::StrCat("the request does not fit ", message->GetDescriptor()->full_name(), ": ",
                   Utf8Prefix(std::string_view(parsed.message().data(), parsed.message().size()),
                              2 * kMaxShown)));
}

}  // namespace

absl::Status FieldInvalid(std::string_view field, std::string_view why) {
  const std::string name = Utf8Prefix(field, kMaxShown);
  return InvalidInput("REQUEST_FIELD_INVALID", name,
                      absl::StrCat("\"", name, "\": ", std::string(why)));
}

std::unique_ptr<Message> NewRequest(const Route& route) {
  return New(MethodOf(route).input_type());
}
std::unique_ptr<Message> NewResponse(const Route& route) {
  return New(MethodOf(route).output_type());
}

absl::StatusOr<std::unique_ptr<Message>> RequestOf(const Match& match, const Head& head,
                                                   std::string_view body) {
  std::unique_ptr<Message> request = NewRequest(*match.route);
  LITAGS_ASSIGN_OR_RETURN(json fields, FromBody(*match.route, body));
  LITAGS_RETURN_IF_ERROR(PutAll(match.fields, request->GetDescriptor(), &fields));
  LITAGS_RETURN_IF_ERROR(PutAll(head.query, request->GetDescriptor(), &fields));
  LITAGS_RETURN_IF_ERROR(Parse(fields, request.get()));
  return request;
}

absl::Status FillFields(const Fields& fields, Message* message) {
  json object = json::object();
  LITAGS_RETURN_IF_ERROR(PutAll(fields, message->GetDescriptor(), &object));
  return Parse(object, message);
}

absl::StatusOr<std::string> JsonOf(const Message& message) {
  std::string text;
  const auto status = google::protobuf::util::MessageToJsonString(message, &text);
  if (status.ok()) return text;
  return absl::InternalError(
      absl::StrCat("cannot write ", message.GetDescriptor()->full_name(), " as JSON"));
}

}  // namespace litags::web
