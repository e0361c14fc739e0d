#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <utility>

namespace limn::wizard {

/// Runs functions of one other thread in the main thread, which owns windows and monitors.
class MainThreadExecutor {
 public:
  /// Called by the other thread. Returns when the main thread has run the function.
  void run(const std::function<void()>& task) {
    std::unique_lock lock(mutex_);
    task_ = &task;
    wanted_.notify_one();
    done_.wait(lock, [this] { return task_ == nullptr; });
  }

  /// Called by the main thread. Runs the function that waits or arrives within `wait`, if there is one.
  void serve(std::chrono::nanoseconds wait = {}) {
    std::unique_lock lock(mutex_);
    if (!wanted_.wait_for(lock, wait, [this] { return task_ != nullptr; })) return;
    (*task_)();
    task_ = nullptr;
    done_.notify_one();
  }

 private:
  std::mutex mutex_;
  std::condition_variable wanted_, done_;
  const std::function<void()>* task_ = nullptr;
};

}  // namespace limn::wizard
