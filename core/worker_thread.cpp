#include "core/worker_thread.h"

#include <sys/resource.h>
#include <unistd.h>

namespace limn {
namespace {

constexpr int k_worker_nice = 10;

}  // namespace

// On Linux each thread has its own nice value.
void step_back(int nice) { static_cast<void>(setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), nice)); }

WorkerThread::WorkerThread() : thread_([this] { run(); }) {}

void WorkerThread::close() {
  {
    const std::lock_guard lock(mutex_);
    is_closing_ = true;
    jobs_.clear();
  }
  changed_.notify_all();
  if (thread_.joinable()) thread_.join();
}

bool WorkerThread::add_job(std::function<void()> job) {
  {
    const std::lock_guard lock(mutex_);
    if (is_closing_ || jobs_.size() >= k_most_jobs) return false;
    jobs_.push_back(std::move(job));
  }
  changed_.notify_all();
  return true;
}

void WorkerThread::run() {
  step_back(k_worker_nice);
  for (;;) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return is_closing_ || !jobs_.empty(); });
    if (is_closing_) return;
    const std::function<void()> job = std::move(jobs_.front());
    jobs_.pop_front();
    lock.unlock();
    job();
  }
}

}  // namespace limn
