#include "core/parallel.h"

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <system_error>
#include <thread>
#include <vector>

namespace limn {

void run_on_threads(int threads, const std::function<void()>& work) {
  std::exception_ptr first;
  std::mutex mutex;
  const auto run = [&] {
    try {
      work();
    } catch (...) {
      const std::lock_guard lock(mutex);
      if (!first) first = std::current_exception();
    }
  };
  {
    std::vector<std::jthread> others;
    others.reserve(static_cast<std::size_t>(std::max(0, threads - 1)));
    try {
      while (static_cast<int>(others.size()) + 1 < threads) others.emplace_back(run);
    } catch (const std::system_error&) {  // The system has no more threads.
    }
    run();
  }
  if (first) std::rethrow_exception(first);
}

void parallel_for(int count, const std::function<void(int)>& work) {
  std::atomic<int> next = 0;
  const auto work_on_all = [&] {
    try {
      for (int i = next++; i < count; i = next++) work(i);
    } catch (...) {
      next = count;
      throw;
    }
  };
  run_on_threads(std::min(count, static_cast<int>(std::thread::hardware_concurrency())), work_on_all);
}

}  // namespace limn
