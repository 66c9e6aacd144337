#ifndef LITAGS_ENGINE_PIPELINE_EXCEPTION_STATUS_H_
#define LITAGS_ENGINE_PIPELINE_EXCEPTION_STATUS_H_

#include "absl/status/status.h"

namespace litags {

// The error for the exception that is being caught: RESOURCE_EXHAUSTED (MEMORY_EXCEEDED) where
// memory, OpenCV's as well, is used up; else INTERNAL with what the exception says.
absl::Status StatusOfException();

// What `call` returns, a Status or a StatusOr: no exception leaves the engine.
template <typename Call>
auto WithoutExceptions(const Call& call) -> decltype(call()) {
  try {
    return call();
  } catch (...) {
    return StatusOfException();
  }
}

}  // namespace litags

#endif  // LITAGS_ENGINE_PIPELINE_EXCEPTION_STATUS_H_
