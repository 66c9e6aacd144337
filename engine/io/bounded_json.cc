#include "engine/io/bounded_json.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "absl/strings/numbers.h"
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
  int values = 0;
  bool too_large = false;
  const auto keep = [&](int depth, Json::parse_event_t event, Json& parsed) {
    too_large = too_large || depth > kMaxDepth || ++values > kMaxValues;
    if (too_large) return false;
    if (event != Json::parse_event_t::key) return true;
    const auto& key = parsed.get_ref<const std::string&>();
    return std::find(dropped.begin(), dropped.end(), key) == dropped.end();
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
  return value.is_number_integer() ? value.dump() : "";
}

const Json& Member(const Json& object, const char* key) {
  static const Json* const kNone = new Json();
  if (!object.is_object()) return *kNone;
  const auto found = object.find(key);
  return found == object.end() ? *kNone : *found;
}

}  // namespace litags
