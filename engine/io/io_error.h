// Inside this module: errors whose message starts with the input they are about.
#ifndef LITAGS_ENGINE_IO_IO_ERROR_H_
#define LITAGS_ENGINE_IO_IO_ERROR_H_

#include <string_view>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "engine/core/error.h"

namespace litags {

inline absl::string_view Absl(std::string_view s) { return {s.data(), s.size()}; }

inline absl::Status FieldError(absl::StatusCode code, std::string_view reason,
                               std::string_view field, std::string_view message) {
  return MakeError(code, reason, field, absl::StrCat(Absl(field), ": ", Absl(message)));
}

inline absl::Status InvalidField(std::string_view reason, std::string_view field,
                                 std::string_view message) {
  return FieldError(absl::StatusCode::kInvalidArgument, reason, field, message);
}

}  // namespace litags

#endif  // LITAGS_ENGINE_IO_IO_ERROR_H_
