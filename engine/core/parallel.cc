#include "engine/core/parallel.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <exception>
#include <limits>
#include <new>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include "engine/core/check.h"
#include "engine/core/loop_trace.h"
#include "engine/core/machine_memory.h"

#if defined(__x86_64__)
#include <immintrin.h>
#endif

namespace litags {
namespace {

constexpr size_t kCacheLine = 64;

void Pause() {
#if defined(__x86_64__)
  _mm_pause();
#endif
}

// Waits until `word` is no longer `old`. Loops follow each other within microseconds, so it looks
// for some 50 us before it sleeps; longer would take the core from other processes.
uint32_t AwaitChange(const std::atomic<uint32_t>& word, uint32_t old) {
  constexpr int kLooks = 3000;
  for (int i = 0; i < kLooks; ++i) {
    const uint32_t now = word.load(std::memory_order_acquire);
    if (now != old) return now;
    Pause();
  }
  word.wait(old, std::memory_order_acquire);
  return word.load(std::memory_order_acquire);
}

thread_local bool inside = false;  // loops inside a loop run on their own thread

class Inside {
 public:
  Inside() { inside = true; }
  ~Inside() { inside = false; }
  Inside(const Inside&) = delete;
  Inside& operator=(const Inside&) = delete;
};

// The helpers of one calling thread. Threads of control never share helpers, so that a picture
// can be rendered while another thread trains.
class Team {
 public:
  Team() = default;
  Team(const Team&) = delete;
  Team& operator=(const Team&) = delete;
  ~Team() {
    Announce(kStop);
    for (std::thread& helper : helpers_) helper.join();
  }

  void Run(int threads, size_t num_tasks, absl::FunctionRef<void(size_t, int)> body) {
    while (static_cast<int>(helpers_.size()) < threads - 1 && AddHelper()) {
    }
    threads = std::min(threads, static_cast<int>(helpers_.size()) + 1);
    if (shares_.size() < static_cast<size_t>(threads)) shares_ = std::vector<Share>(threads);
    for (int i = 0; i < threads; ++i) {
      shares_[i].Set(num_tasks * i / threads, num_tasks * (i + 1) / threads);
    }
    Loop loop{threads, body};
    loop_ = &loop;
    gate_.store(0, std::memory_order_release);
    Announce(threads - 1);
    Work(0);
    // Whoever has not come by now, as its core has other work, is not waited for.
    gate_.fetch_or(kClosed, std::memory_order_acq_rel);
    for (uint32_t gate = gate_.load(std::memory_order_acquire); gate != kClosed;) {
      gate = AwaitChange(gate_, gate);
    }
    if (loop.failed) std::rethrow_exception(loop.failure);
  }

 private:
  // False if the machine has no thread left: a limit on processes, or on memory.
  bool AddHelper() {
    try {
      helpers_.emplace_back(
          [this, index = helpers_.size(), start = round_.load()] { Help(index, start); });
      return true;
    } catch (const std::system_error&) {
      return false;
    } catch (const std::bad_alloc&) {
      return false;
    }
  }

  // The tasks [begin, end) of a loop that are left of one thread's share, on a cache line of its
  // own. Its thread takes them from the front, others that have done theirs from the back.
  class alignas(kCacheLine) Share {
   public:
    void Set(uint32_t begin, uint32_t end) {
      left_.store(uint64_t{end} << 32 | begin, std::memory_order_relaxed);
    }
    // False if none is left.
    bool Take(bool from_front, uint32_t* task) {
      uint64_t left = left_.load(std::memory_order_relaxed), rest;
      do {
        const auto begin = static_cast<uint32_t>(left), end = static_cast<uint32_t>(left >> 32);
        if (begin == end) return false;
        *task = from_front ? begin : end - 1;
        rest = from_front ? left + 1 : left - (uint64_t{1} << 32);
      } while (!left_.compare_exchange_weak(left, rest, std::memory_order_relaxed));
      return true;
    }

   private:
    std::atomic<uint64_t> left_{0};
  };

  struct Loop {
    int threads;
    absl::FunctionRef<void(size_t, int)> body;
    std::atomic<bool> failed = false;
    std::exception_ptr failure = nullptr;  // of the thread that set `failed`
  };

  // Around all tasks of a thread, where a try costs nothing.
  void Work(int thread) {
    try {
      for (int i = 0; i < loop_->threads; ++i) {
        Share& share = shares_[(thread + i) % loop_->threads];
        for (uint32_t task; share.Take(i == 0, &task);) loop_->body(task, thread);
      }
    } catch (...) {
      if (!loop_->failed.exchange(true)) loop_->failure = std::current_exception();
      for (int i = 0; i < loop_->threads; ++i) shares_[i].Set(0, 0);
    }
  }

  // The low bits of a round say how many helpers take part. The others touch nothing.
  static constexpr uint32_t kCountMask = 0xFFF, kStop = kCountMask;
  static constexpr uint32_t kClosed = uint32_t{1} << 31;

  void Announce(uint32_t count) {
    const uint32_t round = round_.load(std::memory_order_relaxed);
    // Sequentially consistent, as notify_all() asks whether anyone waits: were that read before the
    // store is seen, a helper that goes to sleep meanwhile would never be woken.
    round_.store((round & ~kCountMask) + kCountMask + 1 + count, std::memory_order_seq_cst);
    round_.notify_all();
  }

  // False if the loop has no tasks left. It may be a later one than that which woke the helper.
  bool Enter() {
    uint32_t gate = gate_.load(std::memory_order_acquire);
    while ((gate & kClosed) == 0) {
      if (gate_.compare_exchange_weak(gate, gate + 1, std::memory_order_acq_rel)) return true;
    }
    return false;
  }

  void Leave() {
    // The last one wakes Run(). Sequentially consistent as in Announce().
    if (gate_.fetch_sub(1, std::memory_order_seq_cst) == kClosed + 1) gate_.notify_one();
  }

  void Help(size_t index, uint32_t seen) {
    inside = true;
    for (;;) {
      seen = AwaitChange(round_, seen);
      const uint32_t count = seen & kCountMask;
      if (count == kStop) return;
      if (index >= count || !Enter()) continue;
      const int thread = static_cast<int>(index) + 1;
      if (thread < loop_->threads) Work(thread);
      Leave();
    }
  }

  std::vector<std::thread> helpers_;
  std::atomic<uint32_t> round_{0};
  std::atomic<uint32_t> gate_{kClosed};  // helpers at work; kClosed: no more may come
  std::vector<Share> shares_;            // by thread
  Loop* loop_ = nullptr;
};

class LoopTracer;

thread_local LoopTracer* tracer = nullptr;

// Takes over the loops of this thread as long as it lives.
class LoopTracer {
 public:
  LoopTracer() { tracer = this; }
  ~LoopTracer() { tracer = nullptr; }
  LoopTracer(const LoopTracer&) = delete;
  LoopTracer& operator=(const LoopTracer&) = delete;

  void Run(size_t num_tasks, absl::FunctionRef<void(size_t, int)> body, const char* file,
           int line) {
    trace_.loops.push_back({file, line, Lap(), {}});
    LoopTrace& loop = trace_.loops.back();
    loop.tasks_ms.reserve(num_tasks);
    for (size_t i = 0; i < num_tasks; ++i) {
      body(i, 0);
      loop.tasks_ms.push_back(Lap());
    }
  }

  Trace End() {
    trace_.after_ms = Lap();
    return std::move(trace_);
  }

 private:
  // Milliseconds since the last call.
  double Lap() {
    const auto now = std::chrono::steady_clock::now();
    return std::chrono::duration<double, std::milli>(now - std::exchange(last_, now)).count();
  }

  Trace trace_;
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

}  // namespace

int DefaultThreadCount() {
  static const int cores = MachineCores();
  return cores;
}

void ParallelFor(int threads, size_t num_tasks,
                 absl::FunctionRef<void(size_t task, int thread)> body, const char* file,
                 int line) {
  constexpr size_t kMaxThreads = 1024;
  LITAGS_CHECK(num_tasks <= std::numeric_limits<uint32_t>::max());
  if (threads <= 0) threads = DefaultThreadCount();
  threads = static_cast<int>(std::min({size_t(threads), num_tasks, kMaxThreads}));
  if (threads <= 1 || inside) {
    for (size_t i = 0; i < num_tasks; ++i) body(i, 0);
    return;
  }
  thread_local Team team;
  const Inside loop;
  if (tracer != nullptr) {
    tracer->Run(num_tasks, body, file, line);
  } else {
    team.Run(threads, num_tasks, body);
  }
}

Trace TraceLoops(absl::FunctionRef<void()> body) {
  LoopTracer loops;
  body();
  return loops.End();
}

}  // namespace litags
