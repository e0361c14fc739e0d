#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <optional>
#include <utility>

namespace limn {

/// Passes one value between threads: a new value replaces the old one, nothing is queued.
template <class T>
class Latest {
 public:
  /// Replaces a value that was not taken. `merge(old, new)` may copy to the new one what must not be lost.
  void put(T value, const std::function<void(const T&, T&)>& merge = {}) {
    {
      const std::lock_guard lock(mutex_);
      if (value_ && merge) merge(*value_, value);
      value_ = std::move(value);
    }
    changed_.notify_all();
  }

  /// The newest value that was not taken yet; waits up to `wait` for one. nullopt: none came.
  std::optional<T> take_newest(std::chrono::nanoseconds wait) {
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, wait, [&] { return value_.has_value(); });
    return std::exchange(value_, std::nullopt);
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  std::optional<T> value_;
};

}  // namespace limn
