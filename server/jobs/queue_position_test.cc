#include "server/jobs/queue_position.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <string>
#include <tuple>
#include <vector>

#include "absl/strings/str_cat.h"

namespace litags {
namespace {

TEST(QueuePosition, OfOneOwnerByTime) {
  const JobQueue queue{{{"a", "x", 0, 10}, {"b", "x", 0, 20}, {"c", "x", 0, 30}}, {}};
  EXPECT_EQ(QueuePositions(queue), (std::map<std::string, int>{{"a", 1}, {"b", 2}, {"c", 3}}));
}

TEST(QueuePosition, OwnersTakeTurns) {
  const JobQueue queue{{{"a", "x", 0, 10}, {"b", "x", 0, 20}, {"c", "x", 0, 30}, {"d", "y", 0, 40}},
                       {{"x", 1}}};
  EXPECT_EQ(QueuePositions(queue),
            (std::map<std::string, int>{{"d", 1}, {"a", 2}, {"b", 3}, {"c", 4}}));
}

TEST(QueuePosition, PriorityGoesFirst) {
  const JobQueue queue{{{"b", "x", 5, 90}, {"a", "y", 0, 10}}, {{"x", 7}}};
  EXPECT_EQ(QueuePositions(queue), (std::map<std::string, int>{{"b", 1}, {"a", 2}}));
}

// What JobStore::UpdateFirstQueued() promises, taken literally.
std::vector<std::string> TakenOneByOne(JobQueue queue) {
  std::vector<std::string> order;
  while (!queue.waiting.empty()) {
    const auto next =
        std::min_element(queue.waiting.begin(), queue.waiting.end(),
                         [&](const JobQueue::Job& a, const JobQueue::Job& b) {
                           return std::tuple(-a.priority, queue.running[a.owner], a.queue_time_ms) <
                                  std::tuple(-b.priority, queue.running[b.owner], b.queue_time_ms);
                         });
    ++queue.running[next->owner];
    order.push_back(next->id);
    queue.waiting.erase(next);
  }
  return order;
}

TEST(QueuePosition, IsTheOrderInWhichWorkersTakeJobs) {
  std::mt19937 random(7);
  for (int trial = 0; trial < 200; ++trial) {
    JobQueue queue;
    for (int i = 0; i < 30; ++i) {
      queue.waiting.push_back({absl::StrCat("job", i), absl::StrCat("owner", random() % 4),
                               static_cast<int>(random() % 3), 100 + i});
    }
    std::stable_sort(queue.waiting.begin(), queue.waiting.end(),
                     [](const auto& a, const auto& b) { return a.priority > b.priority; });
    for (int i = 0; i < 3; ++i) queue.running[absl::StrCat("owner", i)] = random() % 5;
    const auto positions = QueuePositions(queue);
    const std::vector<std::string> order = TakenOneByOne(queue);
    for (size_t i = 0; i < order.size(); ++i) {
      EXPECT_EQ(positions.at(order[i]), static_cast<int>(i) + 1) << order[i];
    }
  }
}

}  // namespace
}  // namespace litags
