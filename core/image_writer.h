#pragma once

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <filesystem>
#include <memory>
#include <mutex>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <thread>

#include "core/result.h"

namespace limn {

/// Writes captured images as lightly compressed PNG on its own thread, so that the next image can be captured
/// at the same time. The queue is short: store() waits when the disk is slower than the camera.
class ImageWriter {
 public:
  /// At most `most_queued` images wait in the queue (8 grey images of 1920x1080 are 16 MB).
  explicit ImageWriter(std::size_t most_queued = 8);
  ~ImageWriter();  ///< Writes all queued images first.
  ImageWriter(const ImageWriter&) = delete;
  ImageWriter& operator=(const ImageWriter&) = delete;

  /// Queues an image; waits while the queue is full. Returns the first error of an earlier image, if any.
  Status store(const std::filesystem::path& path, const cv::Mat& image);
  /// Queues an image without waiting. If the queue is full (the disk is too slow) or an earlier image could
  /// not be written, the image is dropped and false is returned.
  bool offer(const std::filesystem::path& path, const cv::Mat& image);
  /// Queues bytes that are written to a file unchanged; otherwise as offer(path, image).
  bool offer(const std::filesystem::path& path, std::shared_ptr<const std::string> bytes);
  /// Waits until everything is written. Returns the first error, if any.
  Status finish();

 private:
  struct Job {
    std::filesystem::path path;
    cv::Mat image;
    std::shared_ptr<const std::string> bytes = {};  // if not null, written instead of `image`
  };
  static Status store_image(const Job& job);
  bool offer(Job job);
  void run();
  Status failure() const;  // the caller must hold mutex_

  std::size_t most_queued_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Job> jobs_;
  std::size_t unwritten_ = 0;  // jobs that are queued or being written
  std::optional<Error> failure_;
  bool closing_ = false;
  std::thread thread_;
};

}  // namespace limn
