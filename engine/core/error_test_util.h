#ifndef LITAGS_ENGINE_CORE_ERROR_TEST_UTIL_H_
#define LITAGS_ENGINE_CORE_ERROR_TEST_UTIL_H_

#include <string>

#include "absl/status/status.h"
#include "engine/core/error.h"

namespace litags {

// The reason of an error; its message if it has none; "" of OK.
inline std::string Reason(const absl::Status& status) {
  const auto detail = GetErrorDetail(status);
  return detail ? detail->reason : std::string(status.message());
}

}  // namespace litags

#endif  // LITAGS_ENGINE_CORE_ERROR_TEST_UTIL_H_
