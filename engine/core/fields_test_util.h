// Counts the members of an aggregate, so that a test can tell when its VisitFields lacks one.
#ifndef LITAGS_ENGINE_CORE_FIELDS_TEST_UTIL_H_
#define LITAGS_ENGINE_CORE_FIELDS_TEST_UTIL_H_

#include <cstddef>
#include <utility>

namespace litags {

struct AnyField {
  template <class T>
  operator T() const;  // NOLINT(google-explicit-constructor)
};

template <class S, size_t... kIndex>
constexpr bool TakesFields(std::index_sequence<kIndex...>) {
  return requires { S{(static_cast<void>(kIndex), AnyField())...}; };
}

// The most values that S can be brace-initialised from, nested structs counting as one.
template <class S, size_t kMost = 128>
constexpr size_t CountMembers() {
  if constexpr (kMost == 0) {
    return 0;
  } else if constexpr (TakesFields<S>(std::make_index_sequence<kMost>())) {
    return kMost;
  } else {
    return CountMembers<S, kMost - 1>();
  }
}

}  // namespace litags

#endif  // LITAGS_ENGINE_CORE_FIELDS_TEST_UTIL_H_
