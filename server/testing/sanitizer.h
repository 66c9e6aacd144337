#ifndef LITAGS_SERVER_TESTING_SANITIZER_H_
#define LITAGS_SERVER_TESTING_SANITIZER_H_

namespace litags {

// Built with a sanitizer: it reserves terabytes of address space and keeps freed memory for a
// while, so that limits and sizes of memory mean nothing.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
inline constexpr bool kSanitized = true;
#else
inline constexpr bool kSanitized = false;
#endif

}  // namespace litags

#endif  // LITAGS_SERVER_TESTING_SANITIZER_H_
