// What Ctrl-C does in a program that works for a while.
#ifndef LITAGS_ENGINE_TOOLS_INTERRUPT_INTERRUPT_H_
#define LITAGS_ENGINE_TOOLS_INTERRUPT_INTERRUPT_H_

#include "engine/core/cancel.h"

namespace litags {

inline constexpr int kInterruptedExit = 130;  // a shell's status of a program that SIGINT ended

// The program's token, which SIGINT and SIGTERM cancel from now on. A second signal ends the
// program at once. Call it before other threads start.
const CancelToken& CancelOnInterrupt();

}  // namespace litags

#endif  // LITAGS_ENGINE_TOOLS_INTERRUPT_INTERRUPT_H_
