// LITAGS_CHECK: for what only a bug can cause. Input errors return absl::Status instead.
#ifndef LITAGS_ENGINE_CORE_CHECK_H_
#define LITAGS_ENGINE_CORE_CHECK_H_

#include <cstdio>
#include <cstdlib>

#define LITAGS_CHECK(condition)                                                          \
  do {                                                                                   \
    if (!(condition)) {                                                                  \
      std::fprintf(stderr, "%s:%d: check failed: %s\n", __FILE__, __LINE__, #condition); \
      std::abort();                                                                      \
    }                                                                                    \
  } while (false)

#endif  // LITAGS_ENGINE_CORE_CHECK_H_
