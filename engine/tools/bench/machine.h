// What this machine can do at most.
#ifndef LITAGS_ENGINE_TOOLS_BENCH_MACHINE_H_
#define LITAGS_ENGINE_TOOLS_BENCH_MACHINE_H_

#include <string>

#include "absl/status/status.h"

namespace litags {

// Keeps the kernels to `name` ("AVX2") and what is narrower, from now on: two instruction sets side
// by side on one machine. InvalidArgument if this build or machine lacks it.
absl::Status LimitInstructionSet(const std::string& name);

// GFLOP/s of multiply-adds by `threads` threads together, best of some runs.
double PeakGflops(int threads);

// GB/s moved by a triad over arrays far larger than the caches, best of some runs.
double TriadGbytes(int threads);

}  // namespace litags

#endif  // LITAGS_ENGINE_TOOLS_BENCH_MACHINE_H_
