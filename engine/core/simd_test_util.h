// For tests of vector kernels.
#ifndef LITAGS_ENGINE_CORE_SIMD_TEST_UTIL_H_
#define LITAGS_ENGINE_CORE_SIMD_TEST_UTIL_H_

#include <gtest/gtest.h>

#include <cstdint>

#include "hwy/highway.h"
#include "hwy/targets.h"

namespace litags {

// Calls `body` once for every instruction set that this machine has and this build contains.
template <class Body>
void ForEachTarget(const Body& body) {
  int ran = 0;
  for (int64_t rest = hwy::SupportedTargets() & HWY_TARGETS; rest != 0; rest &= rest - 1) {
    const int64_t target = rest & -rest;
    SCOPED_TRACE(hwy::TargetName(target));
    hwy::SetSupportedTargetsForTest(target);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
    body();
    ++ran;
  }
  hwy::SetSupportedTargetsForTest(0);
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
  EXPECT_GE(ran, 1);
}

}  // namespace litags

#endif  // LITAGS_ENGINE_CORE_SIMD_TEST_UTIL_H_
