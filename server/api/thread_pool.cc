#include "server/api/thread_pool.h"

#include <algorithm>

namespace litags {

ThreadPool::ThreadPool(int threads, size_t max_waiting, absl::Status busy, int max_running)
    : max_waiting_(max_waiting), busy_(std::move(busy)), max_running_(std::max(1, max_running)) {
  for (int i = 0; i < threads; ++i) threads_.emplace_back([this] { Loop(); });
}

void ThreadPool::Stop() {
  {
    std::lock_guard lock(mutex_);
    stop_ = true;
  }
  wake_.notify_all();
  for (std::thread& thread : threads_) thread.join();
  threads_.clear();
}

absl::Status ThreadPool::Try(const std::string& client, std::function<void()> task) {
  {
    std::lock_guard lock(mutex_);
    const auto queue = queues_.find({client, false});
    if ((queue == queues_.end() ? 0 : queue->second.size()) >= max_waiting_) return busy_;
    Add(client, false, std::move(task));
  }
  wake_.notify_one();
  return absl::OkStatus();
}

void ThreadPool::Run(const std::string& client, std::function<void()> task) {
  {
    std::lock_guard lock(mutex_);
    Add(client, true, std::move(task));
  }
  wake_.notify_one();
}

void ThreadPool::Add(const std::string& client, bool is_step, std::function<void()> task) {
  const auto [queue, is_new] = queues_.try_emplace({client, is_step});
  if (is_new) turns_.push_back(queue);
  queue->second.push_back(std::move(task));
}

std::deque<ThreadPool::Queues::iterator>::iterator ThreadPool::NextTurn() {
  return std::find_if(turns_.begin(), turns_.end(), [this](const Queues::iterator& queue) {
    const auto running = running_.find(queue->first.first);
    return running == running_.end() || running->second < max_running_;
  });
}

std::function<void()> ThreadPool::Take(std::deque<Queues::iterator>::iterator turn) {
  const Queues::iterator queue = *turn;
  turns_.erase(turn);
  std::function<void()> task = std::move(queue->second.front());
  queue->second.pop_front();
  if (queue->second.empty()) {
    queues_.erase(queue);
  } else {
    turns_.push_back(queue);
  }
  return task;
}

void ThreadPool::Loop() {
  std::unique_lock lock(mutex_);
  for (;;) {
    auto turn = turns_.end();
    wake_.wait(lock, [&] {
      turn = NextTurn();
      return turn != turns_.end() || (stop_ && turns_.empty());
    });
    if (turn == turns_.end()) return;
    const std::string client = (*turn)->first.first;
    std::function<void()> task = Take(turn);
    ++running_[client];
    lock.unlock();
    task();
    task = nullptr;  // what it holds may take long to let go
    lock.lock();
    if (--running_[client] == 0) running_.erase(client);
    // Its client may run another one now.
    if (!turns_.empty() || stop_) wake_.notify_all();
  }
}

}  // namespace litags
