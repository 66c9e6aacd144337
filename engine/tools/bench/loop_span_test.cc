#include "engine/tools/bench/loop_span.h"

#include <gtest/gtest.h>

#include <vector>

namespace litags {
namespace {

TEST(LoopSpan, IsTheSumOnOneThreadAndTheLongestTaskOnMany) {
  const std::vector<double> tasks = {3, 1, 2, 5, 1};
  EXPECT_DOUBLE_EQ(LoopSpanMs(tasks, 1), 12);
  EXPECT_DOUBLE_EQ(LoopSpanMs(tasks, 5), 5);
  EXPECT_DOUBLE_EQ(LoopSpanMs(tasks, 64), 5);
  EXPECT_DOUBLE_EQ(LoopSpanMs({}, 2), 0);
}

TEST(LoopSpan, AThreadThatHasDoneItsShareTakesTheLastTasksOfAnother) {
  // Thread 0 has done {1, 1} when thread 1 is in its first task; it takes the last one of its.
  EXPECT_DOUBLE_EQ(LoopSpanMs({1, 1, 4, 3}, 2), 5);
  // The long task comes last of its share, and nobody else can start it earlier.
  EXPECT_DOUBLE_EQ(LoopSpanMs({1, 1, 3, 4}, 2), 6);
}

}  // namespace
}  // namespace litags
