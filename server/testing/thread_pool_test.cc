#include "server/api/thread_pool.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <future>
#include <string>
#include <thread>
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
  std::atomic<int> hers = 0;
  {
    ThreadPool pool(3, kMaxWaiting, absl::ResourceExhaustedError("busy"), /*max_running=*/2);
    for (int i = 0; i < 5; ++i) {
      pool.Run("alice", [&] {
        ++hers;
        freed.wait();
      });
    }
    while (hers < 2) std::this_thread::yield();
    pool.Run("bob", [&] { others_turn.set_value(); });
    EXPECT_EQ(others_turn.get_future().wait_for(std::chrono::seconds(10)),
              std::future_status::ready);
    EXPECT_EQ(hers, 2);
    free.set_value();
  }
  EXPECT_EQ(hers, 5);
}

}  // namespace
}  // namespace litags
