#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <utility>

namespace limn::apps {

/// What one other thread wants done in the main thread, where windows and monitors live.
class MainThreadExecutor {
 public:
  /// Of the other thread: returns when the main thread has done it.
  void run(const std::function<void()>& errand) {
    std::unique_lock lock(mutex_);
    errand_ = &errand;
    wanted_.notify_one();
    done_.wait(lock, [this] { return errand_ == nullptr; });
  }

  /// Of the main thread: does what is wanted, if anything is or comes in so long.
  void serve(std::chrono::nanoseconds wait = {}) {
    std::unique_lock lock(mutex_);
    if (!wanted_.wait_for(lock, wait, [this] { return errand_ != nullptr; })) return;
    (*errand_)();
    errand_ = nullptr;
    done_.notify_one();
  }

 private:
  std::mutex mutex_;
  std::condition_variable wanted_, done_;
  const std::function<void()>* errand_ = nullptr;
};

}  // namespace limn::apps
