// Errors of the project: absl::Status with a code, a message for a human that names the thing,
// the value, the rule and the remedy, and a typed detail that programs can read.
#ifndef LITAGS_ENGINE_CORE_ERROR_H_
#define LITAGS_ENGINE_CORE_ERROR_H_

#include <optional>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace litags {

struct ErrorDetail {
  std::string reason;  // UPPER_SNAKE_CASE, stable: "IMAGE_TRUNCATED"
  std::string field;   // the offending input: "images[3.jpg]", "view.pose"; may be empty
};

// Makes a status carrying a detail. `message` says what is wrong and what to do about it.
absl::Status MakeError(absl::StatusCode code, std::string_view reason, std::string_view field,
                       std::string_view message);

inline absl::Status InvalidInput(std::string_view reason, std::string_view field,
                                 std::string_view message) {
  return MakeError(absl::StatusCode::kInvalidArgument, reason, field, message);
}

// The detail of a status made by MakeError; nullopt for any other.
std::optional<ErrorDetail> GetErrorDetail(const absl::Status& status);

}  // namespace litags

#define LITAGS_RETURN_IF_ERROR(expr)                                                       \
  do {                                                                                     \
    if (absl::Status litags_status_ = (expr); !litags_status_.ok()) return litags_status_; \
  } while (false)

#define LITAGS_CONCAT_INNER_(a, b) a##b
#define LITAGS_CONCAT_(a, b) LITAGS_CONCAT_INNER_(a, b)
#define LITAGS_ASSIGN_OR_RETURN(lhs, expr) \
  LITAGS_ASSIGN_OR_RETURN_IMPL_(LITAGS_CONCAT_(litags_statusor_, __LINE__), lhs, expr)
#define LITAGS_ASSIGN_OR_RETURN_IMPL_(tmp, lhs, expr) \
  auto tmp = (expr);                                  \
  if (!tmp.ok()) return tmp.status();                 \
  lhs = std::move(tmp).value()

#endif  // LITAGS_ENGINE_CORE_ERROR_H_
