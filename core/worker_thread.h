#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>

namespace limn {

/// How many jobs may wait.
constexpr std::size_t k_most_jobs = 32;

/// Does what takes long, one thing after the other, on a thread of its own that goes after the others: files
/// are read, images encoded.
class WorkerThread {
 public:
  WorkerThread();
  ~WorkerThread() { close(); }
  WorkerThread(const WorkerThread&) = delete;
  WorkerThread& operator=(const WorkerThread&) = delete;

  /// False: too much waits, and the job is dropped. A job must not throw.
  bool take(std::function<void()> job);
  /// Drops what has not begun, waits for what has, and takes nothing more.
  void close();

 private:
  void run();

  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<std::function<void()>> jobs_;
  bool is_closing_ = false;
  std::thread thread_;
};

/// The calling thread goes after others: projectors first. `nice` as for nice(1).
void step_back(int nice);

}  // namespace limn
