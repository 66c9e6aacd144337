// One list of a struct's fields serves its checks, its text, its command line and its fingerprint.
//
// A struct `S` has such a list as a function template beside it,
//   template <class T, class Visit>  // T: S or const S
//   void VisitFields(FieldsOf<S>, T& s, Visit&& visit) {
//     visit("iterations", s.iterations, FieldRule{.least = 1, .most = 1e6, .help = "..."});
//   }
// and enums that are fields have EnumWords.
#ifndef LITAGS_ENGINE_CORE_FIELDS_H_
#define LITAGS_ENGINE_CORE_FIELDS_H_

#include <cmath>
#include <cstdio>
#include <limits>
#include <optional>
#include <string>
#include <type_traits>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "engine/core/error.h"

namespace litags {

// Names the list of S in overload resolution.
template <class S>
struct FieldsOf {};

struct FieldRule {
  double least = std::numeric_limits<double>::lowest();  // the range, inclusive
  double most = std::numeric_limits<double>::max();
  bool above_least = false;    // `least` itself is outside
  bool below_most = false;     // `most` itself is outside
  bool odd = false;            // odd numbers only
  const char* zero = nullptr;  // 0 is allowed besides the range and means this
  const char* help = "";       // for the command line: subject and unit
  bool shapes_scene = true;    // false: the trained scene is the same bytes for any value
};

// The words of an enum, in the order in which help lists them. Specialised beside the enum.
template <class E>
struct EnumWords;  // static constexpr std::pair<E, const char*> kWords[]

template <class T>
struct IsOptional : std::false_type {};
template <class T>
struct IsOptional<std::optional<T>> : std::true_type {};

template <class E>
const char* WordOf(E value) {
  for (const auto& [known, word] : EnumWords<E>::kWords) {
    if (known == value) return word;
  }
  return "unknown";
}

template <class E>
std::string WordsOf() {
  return absl::StrJoin(EnumWords<E>::kWords, ", ",
                       [](std::string* out, const auto& pair) { out->append(pair.second); });
}

// The value as text that ParseField reads; numbers round-trip. An optional that is not set: "".
template <class T>
std::string FieldText(const T& value) {
  if constexpr (IsOptional<T>::value) {
    return value.has_value() ? FieldText(*value) : std::string();
  } else if constexpr (std::is_enum_v<T>) {
    return WordOf(value);
  } else if constexpr (std::is_same_v<T, bool>) {
    return value ? "true" : "false";
  } else if constexpr (std::is_floating_point_v<T>) {
    char text[40];
    std::snprintf(text, sizeof(text), "%.17g", static_cast<double>(value));
    double shorter = 0;
    const std::string six = absl::StrCat(value);
    return absl::SimpleAtod(six, &shorter) && shorter == value ? six : text;
  } else {
    return absl::StrCat(value);
  }
}

// INVALID_ARGUMENT (BAD_OPTION) on `field` if the value breaks the rule.
template <class T>
absl::Status CheckField(const std::string& field, const T& value, const FieldRule& rule) {
  if constexpr (std::is_arithmetic_v<T> && !std::is_same_v<T, bool>) {
    const auto x = static_cast<double>(value);
    if (rule.zero != nullptr && x == 0) return absl::OkStatus();
    const bool inside = (rule.above_least ? x > rule.least : x >= rule.least) &&
                        (rule.below_most ? x < rule.most : x <= rule.most);
    if (inside && rule.odd && std::fmod(x, 2) == 0) {
      return InvalidInput("BAD_OPTION", field,
                          absl::StrCat(field, ": ", FieldText(value), " is not odd"));
    }
    if (inside) return absl::OkStatus();
    std::string range = absl::StrCat(
        rule.above_least ? "(" : "[", FieldText(rule.least), ", ",
        rule.most < std::numeric_limits<double>::max() ? FieldText(rule.most) : "infinity",
        rule.below_most || rule.most == std::numeric_limits<double>::max() ? ")" : "]");
    if (rule.zero != nullptr) absl::StrAppend(&range, " nor 0 (", rule.zero, ")");
    return InvalidInput(
        "BAD_OPTION", field,
        absl::StrCat(field, ": ", FieldText(value),
                     rule.zero != nullptr ? " is neither in " : " is not in ", range));
  } else if constexpr (std::is_enum_v<T>) {
    if (WordOf(value) == std::string("unknown")) {
      return InvalidInput("BAD_OPTION", field,
                          absl::StrCat(field, ": there is no value ", static_cast<int>(value),
                                       "; choose one of: ", WordsOf<T>()));
    }
  } else if constexpr (IsOptional<T>::value) {
    if (value.has_value()) return CheckField(field, *value, rule);
  }
  return absl::OkStatus();
}

// Reads what FieldText writes. INVALID_ARGUMENT (BAD_OPTION) on `field` if it is no such value.
template <class T>
absl::Status ParseField(const std::string& field, const std::string& text, T* value) {
  const auto bad = [&](const std::string& wanted) {
    return InvalidInput("BAD_OPTION", field,
                        absl::StrCat(field, ": \"", text, "\" is not ", wanted));
  };
  if constexpr (IsOptional<T>::value) {
    if (text.empty()) {
      value->reset();
      return absl::OkStatus();
    }
    return ParseField(field, text, &value->emplace());
  } else if constexpr (std::is_enum_v<T>) {
    for (const auto& [known, word] : EnumWords<T>::kWords) {
      if (text == word) {
        *value = known;
        return absl::OkStatus();
      }
    }
    return bad(absl::StrCat("one of: ", WordsOf<T>()));
  } else if constexpr (std::is_same_v<T, bool>) {
    return absl::SimpleAtob(text, value) ? absl::OkStatus() : bad("true or false");
  } else if constexpr (std::is_same_v<T, double>) {
    return absl::SimpleAtod(text, value) ? absl::OkStatus() : bad("a number");
  } else if constexpr (std::is_same_v<T, float>) {
    return absl::SimpleAtof(text, value) ? absl::OkStatus() : bad("a number");
  } else {
    return absl::SimpleAtoi(text, value) ? absl::OkStatus() : bad("a whole number in range");
  }
}

// The first broken rule, with `prefix` before the field's name.
template <class S>
absl::Status CheckFields(const S& s, const std::string& prefix) {
  absl::Status status;
  VisitFields(FieldsOf<S>(), s, [&](const char* name, const auto& value, const FieldRule& rule) {
    if (status.ok()) status = CheckField(absl::StrCat(prefix, name), value, rule);
  });
  return status;
}

// Sets the field called `name` from text. INVALID_ARGUMENT (BAD_OPTION) with the names there
// are, or the errors of ParseField and CheckField.
template <class S>
absl::Status SetField(const std::string& name, const std::string& text, S* s) {
  absl::Status status;
  bool found = false;
  std::vector<std::string> names;
  VisitFields(FieldsOf<S>(), *s, [&](const char* known, auto& value, const FieldRule& rule) {
    names.emplace_back(known);
    if (name != known) return;
    found = true;
    auto wanted = value;
    status = ParseField(known, text, &wanted);
    if (status.ok()) status = CheckField(known, wanted, rule);
    if (status.ok()) value = wanted;
  });
  if (found) return status;
  return InvalidInput(
      "BAD_OPTION", name,
      absl::StrCat("there is no \"", name, "\"; choose one of: ", absl::StrJoin(names, " ")));
}

// "name=value", a line each; of the fields that shape the scene alone, or of all.
template <class S>
std::string FieldsText(const S& s, bool shaping_only = false) {
  std::string text;
  VisitFields(FieldsOf<S>(), s, [&](const char* name, const auto& value, const FieldRule& rule) {
    if (!shaping_only || rule.shapes_scene)
      absl::StrAppend(&text, name, "=", FieldText(value), "\n");
  });
  return text;
}

}  // namespace litags

#endif  // LITAGS_ENGINE_CORE_FIELDS_H_
