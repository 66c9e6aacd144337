// What gRPC guarantees, said to ThreadSanitizer, which cannot see it inside a library that is not
// instrumented: OnReadDone() and OnWriteDone() come after the start of what they answer, calls
// after that of the server, and so after all that was written before it.
#ifndef LITAGS_SERVER_API_GRPC_ORDER_H_
#define LITAGS_SERVER_API_GRPC_ORDER_H_

#ifdef LITAGS_TSAN
#include <sanitizer/tsan_interface.h>
#endif

namespace litags {

// To be called by a reactor right before StartRead() or StartWrite(), for the gate before its
// server starts.
inline void BeforeStart([[maybe_unused]] void* who) {
#ifdef LITAGS_TSAN
  __tsan_release(who);
#endif
}

// To be called first in OnReadDone() or OnWriteDone(), by the gate when a call comes.
inline void AfterStart([[maybe_unused]] void* who) {
#ifdef LITAGS_TSAN
  __tsan_acquire(who);
#endif
}

}  // namespace litags

#endif  // LITAGS_SERVER_API_GRPC_ORDER_H_
