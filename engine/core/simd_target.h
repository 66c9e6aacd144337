// Which of the compiled instruction sets the kernels run with.
#ifndef LITAGS_ENGINE_CORE_SIMD_TARGET_H_
#define LITAGS_ENGINE_CORE_SIMD_TARGET_H_

namespace litags {

// What Highway chose on this machine, e.g. "AVX2".
const char* SimdTarget();

}  // namespace litags

#endif  // LITAGS_ENGINE_CORE_SIMD_TARGET_H_
