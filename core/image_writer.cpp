#include "core/image_writer.h"

#include "core/file.h"
#include "core/image_io.h"

namespace limn {

// An exception must not leave the thread.
Status ImageWriter::store_image(const Job& job) {
  try {
    return job.bytes ? write_file(job.path, *job.bytes) : write_png(job.path, job.image, {.compression = 1});
  } catch (const std::exception& problem) {
    return error("{}: cannot encode this image: {}.", job.path.string(), problem.what());
  }
}

ImageWriter::ImageWriter(std::size_t most_queued) : most_queued_(most_queued), thread_([this] { run(); }) {}

ImageWriter::~ImageWriter() {
  {
    const std::lock_guard lock(mutex_);
    closing_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

Status ImageWriter::failure() const { return failure_ ? Status(*failure_) : Status(); }

Status ImageWriter::store(const std::filesystem::path& path, const cv::Mat& image) {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] { return jobs_.size() < most_queued_; });
  jobs_.push_back({path, image});
  ++unwritten_;
  changed_.notify_all();
  return failure();
}

bool ImageWriter::offer(const std::filesystem::path& path, const cv::Mat& image) {
  return offer({path, image});
}

bool ImageWriter::offer(const std::filesystem::path& path, std::shared_ptr<const std::string> bytes) {
  return offer({path, {}, std::move(bytes)});
}

bool ImageWriter::offer(Job job) {
  const std::lock_guard lock(mutex_);
  if (failure_ || jobs_.size() >= most_queued_) return false;
  jobs_.push_back(std::move(job));
  ++unwritten_;
  changed_.notify_all();
  return true;
}

Status ImageWriter::finish() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] { return unwritten_ == 0; });
  return failure();
}

void ImageWriter::run() {
  std::unique_lock lock(mutex_);
  for (;;) {
    changed_.wait(lock, [&] { return closing_ || !jobs_.empty(); });
    if (jobs_.empty()) return;
    const Job job = std::move(jobs_.front());
    jobs_.pop_front();
    changed_.notify_all();
    lock.unlock();
    const Status written = store_image(job);
    lock.lock();
    if (!written && !failure_) failure_ = written.error();
    --unwritten_;
    changed_.notify_all();
  }
}

}  // namespace limn
