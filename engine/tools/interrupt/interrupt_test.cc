#include "engine/tools/interrupt/interrupt.h"

#include <gtest/gtest.h>

#include <csignal>
#include <cstdio>

namespace litags {
namespace {

class Interrupt : public testing::TestWithParam<int> {};

TEST_P(Interrupt, TheFirstSignalCancelsAndTheSecondEndsTheProgram) {
  const auto interrupt_twice = [] {
    const CancelToken& token = CancelOnInterrupt();
    if (token.IsCancelled()) return;
    std::raise(GetParam());
    if (!token.IsCancelled()) return;
    std::fputs("cancelled\n", stderr);
    std::raise(GetParam());
  };
  EXPECT_EXIT(interrupt_twice(), testing::KilledBySignal(GetParam()), "^cancelled\n$");
}

INSTANTIATE_TEST_SUITE_P(Signals, Interrupt, testing::Values(SIGINT, SIGTERM));

}  // namespace
}  // namespace litags
