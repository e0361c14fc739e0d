#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>

namespace limn {

/// Largest number of waiting jobs.
constexpr std::size_t k_most_jobs = 32;

/// Runs long jobs one after another on its own low-priority thread, such as reading files or encoding images.
class WorkerThread {
 public:
  WorkerThread();
  ~WorkerThread() { close(); }
  WorkerThread(const WorkerThread&) = delete;
  WorkerThread& operator=(const WorkerThread&) = delete;

  /// Queues a job. False: too many jobs wait, or close() was called; the job is dropped. A job must not
  /// throw.
  bool add_job(std::function<void()> job);
  /// Drops the jobs that have not begun, waits for a running one, and accepts no more.
  void close();

 private:
  void run();

  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<std::function<void()>> jobs_;
  bool is_closing_ = false;
  std::thread thread_;
};

/// Lowers the priority of the calling thread, so that projectors come first. `nice` is as for nice(1).
void step_back(int nice);

}  // namespace limn
