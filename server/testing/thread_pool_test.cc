#include "server/api/thread_pool.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <future>
#include <string>
#include <vector>

namespace litags {
namespace {

using ::testing::ElementsAre;

constexpr size_t kMaxWaiting = 2;

// A pool whose one thread does nothing until End(), which returns what then ran, in order.
class BusyPool {
 public:
  BusyPool() {
    pool_.Run("", [&] {
      begun_.set_value();
      free_.get_future().wait();
    });
    begun_.get_future().wait();
  }

  bool Try(const std::string& client, const std::string& name) {
    return pool_.Try(client, [this, name] { ran_.push_back(name); }).ok();
  }
  void Run(const std::string& client, const std::string& name) {
    pool_.Run(client, [this, name] { ran_.push_back(name); });
  }

  std::vector<std::string> End() {
    free_.set_value();
    pool_.Stop();
    return ran_;
  }

 private:
  std::promise<void> begun_, free_;
  std::vector<std::string> ran_;
  ThreadPool pool_{1, kMaxWaiting, absl::ResourceExhaustedError("busy")};
};

TEST(ThreadPool, StepsOfOpenStreamsLeaveNewCallsTheirPlaceAndTheirTurn) {
  BusyPool pool;
  for (int i = 0; i < 50; ++i) pool.Run("alice", "step");
  EXPECT_TRUE(pool.Try("alice", "call"));
  EXPECT_TRUE(pool.Try("alice", "call"));
  EXPECT_FALSE(pool.Try("alice", "call"));
  const std::vector<std::string> ran = pool.End();
  ASSERT_EQ(ran.size(), 52u);
  EXPECT_EQ(ran[1], "call");
  EXPECT_EQ(ran[3], "call");
}

TEST(ThreadPool, ClientsTakeTurnsAndFillOnlyTheirOwnQueue) {
  BusyPool pool;
  EXPECT_TRUE(pool.Try("alice", "a1"));
  EXPECT_TRUE(pool.Try("alice", "a2"));
  EXPECT_FALSE(pool.Try("alice", "a3"));
  EXPECT_TRUE(pool.Try("bob", "b1"));
  EXPECT_THAT(pool.End(), ElementsAre("a1", "b1", "a2"));
}

TEST(ThreadPool, LongTasksOfOneClientLeaveAThreadForOthers) {
  std::promise<void> free, others_turn;
  const std::shared_future<void> freed = free.get_future().share();
  std::atomic<int> hers = 0, at_once = 0;
  {
    ThreadPool pool(3, kMaxWaiting, absl::ResourceExhaustedError("busy"), /*max_running=*/2);
    for (int i = 0; i < 5; ++i) {
      pool.Run("alice", [&] {
        at_once = std::max(at_once.load(), ++hers);
        freed.wait();
        --hers;
      });
    }
    pool.Run("bob", [&] { others_turn.set_value(); });
    others_turn.get_future().wait();  // for ever, if hers had all threads
    free.set_value();
  }
  EXPECT_LE(at_once, 2);
}

}  // namespace
}  // namespace litags
