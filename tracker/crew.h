#pragma once

#include <atomic>
#include <cstdint>
#include <exception>
#include <opencv2/core/utility.hpp>

namespace limn::tracker {

/// Threads of OpenCV's pool that work on one picture together. They stay awake from its first to its last
/// step: waking one takes as long as some of the steps.
class Crew {
 public:
  /// cv::setNumThreads limits how many of them there are.
  explicit Crew(int size) : size_(size) {}

  int size() const { return size_; }

  /// Calls lead(); the others help with what it hands to at_once(). Throws what lead() throws.
  template <typename Lead>
  void work(const Lead& lead) {
    if (size_ == 1) return lead();
    has_lead_ = has_ended_ = false;
    cv::parallel_for_(
        cv::Range(0, size_),
        [&](const cv::Range& range) {
          for (int i = range.start; i < range.end; ++i) has_lead_.exchange(true) ? help() : lead_on(lead);
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
  void at_once(int count, const Work& work) {
    if (size_ == 1 || count == 1) {
      for (int i = 0; i < count; ++i) work(i);
      return;
    }
    share_out(count, &work, [](const void* w, int i) { (*static_cast<const Work*>(w))(i); });
  }

 private:
  using Call = void (*)(const void* work, int i);
  int size_;
  std::atomic<bool> has_lead_ = false, has_ended_ = true;
  // What is shared out: its number, how many there are of it and the next of them, 32, 16 and 16 bits.
  std::atomic<std::uint64_t> shares_ = 0;
  std::atomic<int> left_ = 0;  // that have not ended
  std::atomic<bool> has_failed_ = false;
  std::exception_ptr failure_;
  const void* work_ = nullptr;
  Call call_ = nullptr;

  template <typename Lead>
  void lead_on(const Lead& lead) {
    struct End {
      std::atomic<bool>& has_ended;
      ~End() { has_ended = true; }
    } end{has_ended_};
    lead();
  }
  static void pause(int times);
  void help();
  bool take_one();
  void share_out(int count, const void* work, Call call);
};

}  // namespace limn::tracker
