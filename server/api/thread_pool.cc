#include "server/api/thread_pool.h"

namespace litags {

ThreadPool::ThreadPool(int threads, size_t max_waiting, absl::Status busy)
    : max_waiting_(max_waiting), busy_(std::move(busy)) {
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

std::function<void()> ThreadPool::TakeNext() {
  const auto queue = turns_.front();
  turns_.pop_front();
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
  for (;;) {
    std::function<void()> task;
    {
      std::unique_lock lock(mutex_);
      wake_.wait(lock, [this] { return stop_ || !turns_.empty(); });
      if (turns_.empty()) return;
      task = TakeNext();
    }
    task();
  }
}

}  // namespace litags
