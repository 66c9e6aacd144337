#include "engine/core/parallel.h"

#include <gtest/gtest.h>
#include <pthread.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <future>
#include <new>
#include <set>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "engine/core/loop_trace.h"
#include "engine/core/machine_memory.h"
#include "engine/core/sandbox.h"

namespace litags {
namespace {

// Which write and read ends of pipes the handler uses.
int stopped[2], go_on[2];

void Stop(int) {
  char byte = 0;
  if (write(stopped[1], &byte, 1) != 1 || read(go_on[0], &byte, 1) != 1) _exit(1);
}

// A loop's helper thread: both threads take one of two tasks.
pthread_t HelperOfThisThread() {
  std::atomic<int> at_work = 0;
  pthread_t helper = pthread_self();
  ParallelFor(2, 2, [&](size_t, int thread) {
    if (thread == 1) helper = pthread_self();
    ++at_work;
    while (at_work < 2) std::this_thread::yield();
  });
  return helper;
}

TEST(DefaultThreadCount, IsWhatControlGroupsLeave) {
  EXPECT_EQ(DefaultThreadCount(), MachineCores());
}

TEST(ParallelFor, DoesNotWaitForAThreadThatDoesNotCome) {
  ASSERT_EQ(pipe(stopped), 0);
  ASSERT_EQ(pipe(go_on), 0);
  struct sigaction action = {};
  action.sa_handler = Stop;
  ASSERT_EQ(sigaction(SIGUSR1, &action, nullptr), 0);
  std::promise<std::vector<int>> done;
  std::future<std::vector<int>> threads_of_tasks = done.get_future();
  std::thread caller([&] {
    const pthread_t helper = HelperOfThisThread();
    char byte = 0;
    // A core that has other work.
    EXPECT_EQ(pthread_kill(helper, SIGUSR1), 0);
    EXPECT_EQ(read(stopped[0], &byte, 1), 1);
    std::vector<int> threads(100, -1);
    ParallelFor(2, threads.size(), [&](size_t task, int thread) { threads[task] = thread; });
    done.set_value(threads);
  });
  const bool ended =
      threads_of_tasks.wait_for(std::chrono::seconds(60)) == std::future_status::ready;
  char byte = 0;
  EXPECT_EQ(write(go_on[1], &byte, 1), 1);
  caller.join();
  EXPECT_TRUE(ended) << "the loop waited for its second thread";
  EXPECT_EQ(threads_of_tasks.get(), std::vector<int>(100, 0));
}

TEST(ParallelFor, LoopsInQuickSuccessionDoEveryTaskOnce) {
  for (int loop = 0; loop < 20'000; ++loop) {
    const int threads = 2 + loop % 3, tasks = 1 + loop % 17;
    std::vector<std::atomic<int>> times(tasks);
    ParallelFor(threads, tasks, [&](size_t task, int thread) {
      ASSERT_LT(thread, threads);
      ++times[task];
    });
    for (const std::atomic<int>& n : times) ASSERT_EQ(n, 1) << loop;
  }
}

TEST(ParallelFor, ALoopInsideALoopRunsOnItsOwnThreadOnEveryThread) {
  std::atomic<int> at_work = 0;
  ParallelFor(2, 2, [&](size_t, int) {
    ++at_work;
    while (at_work < 2) std::this_thread::yield();  // each thread takes one of the two tasks
    const std::thread::id here = std::this_thread::get_id();
    ParallelFor(2, 50, [&](size_t, int thread) {
      EXPECT_EQ(thread, 0);
      EXPECT_EQ(std::this_thread::get_id(), here);
      std::this_thread::sleep_for(std::chrono::milliseconds(1));  // others would have come
    });
  });
}

TEST(ParallelFor, DoesEveryTaskOnThreadsThatCouldBeStarted) {
  const pid_t child = fork();
  if (child == 0) {
    if (SyscallFilter::ForComputing().Apply() != 0) _exit(2);  // clone: EPERM
    std::atomic<int> tasks = 0;
    // More threads than a test before this one may have had.
    ParallelFor(50, 100, [&](size_t, int) { ++tasks; });
    ParallelFor(50, 100, [&](size_t, int) { ++tasks; });
    _exit(tasks == 200 ? 0 : 1);
  }
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  EXPECT_TRUE(WIFEXITED(status)) << "signal " << WTERMSIG(status);
  EXPECT_EQ(WEXITSTATUS(status), 0);
}

// How many threads have done one of `threads` tasks, each of which waits for all others to begin.
size_t ThreadsTogether(int threads) {
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(20);
  std::atomic<int> at_work = 0;
  std::vector<std::thread::id> ids(threads);
  ParallelFor(threads, threads, [&](size_t task, int) {
    ids[task] = std::this_thread::get_id();
    ++at_work;
    while (at_work < threads && std::chrono::steady_clock::now() < deadline) {
      std::this_thread::yield();
    }
  });
  return std::set<std::thread::id>(ids.begin(), ids.end()).size();
}

TEST(ParallelFor, WhatATaskThrowsOnAnyThreadComesToTheCallerAndLaterLoopsHaveAllThreads) {
  for (int thrower = 0; thrower < 3; ++thrower) {
    std::atomic<int> at_work = 0;
    std::string caught;
    try {
      ParallelFor(3, 3, [&](size_t, int thread) {
        ++at_work;
        while (at_work < 3) std::this_thread::yield();  // each thread takes one of the tasks
        // A loop in a task, which runs on the thread of the task.
        if (thread == thrower) {
          ParallelFor(3, 2, [&](size_t, int) { throw std::runtime_error("of a task"); });
        }
      });
    } catch (const std::runtime_error& e) {
      caught = e.what();
    }
    EXPECT_EQ(caught, "of a task") << thrower;
    EXPECT_EQ(ThreadsTogether(3), 3) << thrower;
  }
}

TEST(ParallelFor, ThrowsOneExceptionWhereAllThreadsThrow) {
  std::atomic<int> at_work = 0;
  EXPECT_THROW(ParallelFor(3, 1000,
                           [&](size_t, int) {
                             ++at_work;
                             while (at_work < 3) std::this_thread::yield();
                             throw std::bad_alloc();
                           }),
               std::bad_alloc);
  EXPECT_EQ(at_work, 3) << "a thread went on after its exception";
  EXPECT_EQ(ThreadsTogether(3), 3);
}

TEST(ParallelFor, BeginsNoFurtherTaskOnceOneHasThrown) {
  constexpr int kTasks = 5000;
  std::atomic<int> begun = 0;
  EXPECT_THROW(ParallelFor(2, kTasks,
                           [&](size_t, int thread) {
                             ++begun;
                             while (begun < 2) std::this_thread::yield();  // both are at work
                             if (thread == 0) throw std::bad_alloc();
                             std::this_thread::sleep_for(std::chrono::milliseconds(1));
                           }),
               std::bad_alloc);
  EXPECT_LT(begun, kTasks);
}

TEST(TraceLoops, EndsWhereItsBodyThrows) {
  const auto trace = [] {
    TraceLoops([] { ParallelFor(3, 3, [](size_t, int) { throw std::bad_alloc(); }); });
  };
  EXPECT_THROW(trace(), std::bad_alloc);
  EXPECT_EQ(ThreadsTogether(3), 3);
}

TEST(TraceLoops, TimesEveryTaskOfLoopsForSeveralThreadsOnThisThread) {
  const auto wait = [] { std::this_thread::sleep_for(std::chrono::milliseconds(2)); };
  const std::thread::id here = std::this_thread::get_id();
  std::vector<size_t> order;
  const Trace trace = TraceLoops([&] {
    wait();
    ParallelFor(8, 3, [&](size_t task, int thread) {
      EXPECT_EQ(thread, 0);
      EXPECT_EQ(std::this_thread::get_id(), here);
      order.push_back(task);
      if (task == 1) wait();
      ParallelFor(8, 2, [](size_t, int) {});  // part of the task
    });
    ParallelFor(1, 5, [](size_t, int) {});  // for one thread
  });
  EXPECT_EQ(order, (std::vector<size_t>{0, 1, 2}));
  ASSERT_EQ(trace.loops.size(), 1);
  EXPECT_NE(std::string(trace.loops[0].file).find("parallel_test.cc"), std::string::npos);
  EXPECT_GE(trace.loops[0].before_ms, 2);
  ASSERT_EQ(trace.loops[0].tasks_ms.size(), 3);
  EXPECT_GE(trace.loops[0].tasks_ms[1], 2);
  // Loops have all their threads again.
  std::atomic<int> tasks = 0;
  ParallelFor(2, 100, [&](size_t, int) { ++tasks; });
  EXPECT_EQ(tasks, 100);
}

}  // namespace
}  // namespace litags
