#include "core/file_writer.h"

namespace limn {

FileWriter::FileWriter() : thread_([this] { run(); }) {}

FileWriter::~FileWriter() {
  {
    const std::lock_guard lock(mutex_);
    is_closing_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

void FileWriter::add(std::function<Status()> job) {
  {
    const std::lock_guard lock(mutex_);
    jobs_.push_back(std::move(job));
  }
  changed_.notify_all();
}

bool FileWriter::is_busy() const {
  const std::lock_guard lock(mutex_);
  return !jobs_.empty();
}

void FileWriter::finish() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] { return jobs_.empty(); });
}

std::vector<std::string> FileWriter::failures() {
  const std::lock_guard lock(mutex_);
  return std::exchange(failures_, {});
}

void FileWriter::run() {
  std::unique_lock lock(mutex_);
  for (;;) {
    changed_.wait(lock, [&] { return is_closing_ || !jobs_.empty(); });
    if (jobs_.empty()) return;
    const std::function<Status()>& job = jobs_.front();  // stays valid when jobs are added
    lock.unlock();
    const Status done = job();
    lock.lock();
    if (!done) failures_.push_back(done.message());
    jobs_.pop_front();
    changed_.notify_all();
  }
}

}  // namespace limn
