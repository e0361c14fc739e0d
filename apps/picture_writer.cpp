#include "apps/picture_writer.h"

#include "core/picture.h"

namespace limn::apps {
namespace {

constexpr std::size_t k_queue_length = 8;  // pictures; 2 MB each at 1920x1080

// An exception must not leave the thread.
Status stored(const std::filesystem::path& path, const cv::Mat& picture) {
  try {
    return write_png(path, picture, {.compression = 1});
  } catch (const std::exception& problem) {
    return error("{}: cannot encode this picture: {}.", path.string(), problem.what());
  }
}

}  // namespace

PictureWriter::PictureWriter() : thread_([this] { run(); }) {}

PictureWriter::~PictureWriter() {
  {
    const std::lock_guard lock(mutex_);
    closing_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

Status PictureWriter::failure() const { return failure_ ? Status(*failure_) : Status(); }

Status PictureWriter::store(const std::filesystem::path& path, const cv::Mat& picture) {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] { return jobs_.size() < k_queue_length; });
  jobs_.push_back({path, picture});
  ++unwritten_;
  changed_.notify_all();
  return failure();
}

Status PictureWriter::finish() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] { return unwritten_ == 0; });
  return failure();
}

void PictureWriter::run() {
  std::unique_lock lock(mutex_);
  for (;;) {
    changed_.wait(lock, [&] { return closing_ || !jobs_.empty(); });
    if (jobs_.empty()) return;
    const Job job = std::move(jobs_.front());
    jobs_.pop_front();
    changed_.notify_all();
    lock.unlock();
    const Status written = stored(job.path, job.picture);
    lock.lock();
    if (!written && !failure_) failure_ = written.error();
    --unwritten_;
    changed_.notify_all();
  }
}

}  // namespace limn::apps
