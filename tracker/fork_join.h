#pragma once

#include <atomic>
#include <cstdint>
#include <exception>
#include <opencv2/core/utility.hpp>

namespace limn::tracker {

/// Threads of OpenCV's pool that work on one image together. They stay awake from its first to its last
/// step: waking one takes as long as some of the steps.
class WorkerTeam {
 public:
  /// cv::setNumThreads limits how many of them there are.
  explicit WorkerTeam(int size) : size_(size) {}

  int size() const { return size_; }

  /// Calls lead(); the others help with what it hands to parallel_for(). Throws what lead() throws.
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

  /// Waits, awake, for what another of the crew is about to do.
  template <typename Reached>
  static void wait_until(const Reached& reached) {
    for (int times = 1; !reached(); ++times) pause(times);
  }

  /// Calls work(i), i = 0 ... count - 1, at once where there are helpers: for the lead alone, and not from
  /// within `work`. Throws what `work` throws, when all that has begun has ended.
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
  // What is shared out: its number, how many there are of it and the next of them, 32, 16 and 16 bits.
  std::atomic<std::uint64_t> distributed_ = 0;
  std::atomic<int> left_ = 0;  // that have not ended
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
