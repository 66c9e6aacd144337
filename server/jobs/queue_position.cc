#include "server/jobs/queue_position.h"

#include <algorithm>
#include <tuple>
#include <vector>

namespace litags {

std::map<std::string, int> QueuePositions(const JobQueue& queue) {
  // An owner's n-th job leaves when the owner has as many running jobs as now, and n - 1 more; so
  // jobs of one priority leave by that number, then by time. Those of higher priority run before.
  struct Turn {
    int priority;
    int64_t running;
    size_t index;  // in queue.waiting: by time within a priority
  };
  std::map<std::string, int64_t> running = queue.running;
  std::vector<Turn> turns;
  for (size_t i = 0; i < queue.waiting.size(); ++i) {
    const JobQueue::Job& job = queue.waiting[i];
    turns.push_back({job.priority, running[job.owner]++, i});
  }
  std::sort(turns.begin(), turns.end(), [](const Turn& a, const Turn& b) {
    return std::tuple(-a.priority, a.running, a.index) <
           std::tuple(-b.priority, b.running, b.index);
  });
  std::map<std::string, int> positions;
  for (const Turn& turn : turns) {
    positions[queue.waiting[turn.index].id] = static_cast<int>(positions.size()) + 1;
  }
  return positions;
}

}  // namespace litags
