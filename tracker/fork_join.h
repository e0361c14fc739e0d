#pragma once

#include <atomic>
#include <cstdint>
#include <exception>
#include <opencv2/core/utility.hpp>

namespace limn::tracker {

/// Threads of OpenCV's pool that work together on one image. They stay awake from its first step to its last,
/// because waking a thread takes as long as some of the steps.
class WorkerTeam {
 public:
  /// cv::setNumThreads limits the number of threads.
  explicit WorkerTeam(int size) : size_(size) {}

  int size() const { return size_; }

  /// Calls leader() on one thread; the other threads help with what it hands to parallel_for(). Throws what
  /// leader() throws.
  template <typename Lead>
  void work(const Lead& leader) {
    if (size_ == 1) return leader();
    has_leader_ = has_ended_ = false;
    cv::parallel_for_(
        cv::Range(0, size_),
        [&](const cv::Range& range) {
          for (int i = range.start; i < range.end; ++i)
            has_leader_.exchange(true) ? help() : run_leader(leader);
        },
        size_);
  }

  /// Waits, spinning, for something that another thread of the team is about to do.
  template <typename Reached>
  static void wait_until(const Reached& reached) {
    for (int times = 1; !reached(); ++times) pause(times);
  }

  /// Calls work(i), i = 0 ... count - 1, on all threads of the team. Only the leader may call it, and not
  /// from within `work`. Throws what `work` throws, after all calls that have begun have ended.
  template <typename Work>
  void parallel_for(int count, const Work& work) {
    if (size_ == 1 || count == 1) {
      for (int i = 0; i < count; ++i) work(i);
      return;
    }
    distribute(count, &work, [](const void* w, int i) { (*static_cast<const Work*>(w))(i); });
  }

 private:
  using Call = void (*)(const void* work, int i);
  int size_;
  std::atomic<bool> has_leader_ = false, has_ended_ = true;
  // The current parallel_for() in one word: its number (32 bits), its count of calls (16 bits), the index of
  // the next call (16 bits).
  std::atomic<std::uint64_t> distributed_ = 0;
  std::atomic<int> left_ = 0;  // calls that have not ended
  std::atomic<bool> has_failed_ = false;
  std::exception_ptr failure_;
  const void* work_ = nullptr;
  Call call_ = nullptr;

  template <typename Lead>
  void run_leader(const Lead& leader) {
    struct End {
      std::atomic<bool>& has_ended;
      ~End() { has_ended = true; }
    } end{has_ended_};
    leader();
  }
  static void pause(int times);
  void help();
  bool run_next();
  void distribute(int count, const void* work, Call call);
};

}  // namespace limn::tracker
