#include "engine/io/bounded_json.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>

#include "absl/strings/numbers.h"
#include "engine/core/json_text.h"
#include "engine/io/io_error.h"

namespace litags {
namespace {

using Json = nlohmann::json;

constexpr int kMaxDepth = 16;
// Of some 100 bytes each. A photo takes some 60.
constexpr int kMaxValues = 1 << 20;

}  // namespace

absl::StatusOr<Json> ParseBoundedJson(std::string_view text, std::string_view field,
                                      std::span<const std::string_view> dropped) {
  using Event = Json::parse_event_t;
  int values = 0;
  bool too_large = false;
  // Of a dropped member's key, until the next key of its object or that object's end.
  std::optional<int> dropped_depth;
  const auto keep = [&](int depth, Event event, Json& parsed) {
    if (dropped_depth &&
        (depth < *dropped_depth || (depth == *dropped_depth && event == Event::key))) {
      dropped_depth.reset();
    }
    too_large = too_large || depth > kMaxDepth || (!dropped_depth && ++values > kMaxValues);
    if (too_large || dropped_depth) return false;
    if (event != Event::key) return true;
    const auto& key = parsed.get_ref<const std::string&>();
    if (std::find(dropped.begin(), dropped.end(), key) == dropped.end()) return true;
    dropped_depth = depth;
    return false;
  };
  try {
    Json json = Json::parse(text, keep, /*allow_exceptions=*/true);
    if (!too_large) return json;
  } catch (const Json::exception& e) {
    return InvalidField("BAD_JSON", field, absl::StrCat("it is no JSON: ", e.what()));
  }
  return InvalidField("BAD_JSON", field, "it holds too many values; export the cameras alone");
}

bool ReadNumber(const Json& value, double* out) {
  if (value.is_number()) {
    *out = value.get<double>();
  } else if (!value.is_string() || !absl::SimpleAtod(value.get_ref<const std::string&>(), out)) {
    return false;
  }
  return std::isfinite(*out);
}

bool ReadNumbers(const Json& value, std::span<double> out) {
  if (!value.is_array() || value.size() != out.size()) return false;
  for (size_t i = 0; i < out.size(); ++i) {
    if (!ReadNumber(value[i], &out[i])) return false;
  }
  return true;
}

std::string TextOf(const Json& value) {
  if (value.is_string()) return value.get<std::string>();
  return value.is_number_integer() ? JsonText(value) : "";
}

const Json& Member(const Json& object, const char* key) {
  static const Json* const kNone = new Json();
  if (!object.is_object()) return *kNone;
  const auto found = object.find(key);
  return found == object.end() ? *kNone : *found;
}

}  // namespace litags
