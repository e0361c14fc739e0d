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

/// Writes captured images as lightly compressed PNG on a thread of its own, so that the next image is
/// taken meanwhile. The queue is short: store() waits when the disk is slower than the camera.
class ImageWriter {
 public:
  /// `most_queued` images wait at most (8: 16 MB of grey 1920x1080).
  explicit ImageWriter(std::size_t most_queued = 8);
  ~ImageWriter();  ///< writes what is queued
  ImageWriter(const ImageWriter&) = delete;
  ImageWriter& operator=(const ImageWriter&) = delete;

  /// Queues an image; the error is the first one of an earlier image.
  Status store(const std::filesystem::path& path, const cv::Mat& image);
  /// The same without waiting: false when the queue is full (the disk is too slow) or an earlier image
  /// could not be written, and the image is dropped.
  bool offer(const std::filesystem::path& path, const cv::Mat& image);
  /// Likewise a file's bytes as they are.
  bool offer(const std::filesystem::path& path, std::shared_ptr<const std::string> bytes);
  /// Waits until all is written; the first error, if any.
  Status finish();

 private:
  struct Job {
    std::filesystem::path path;
    cv::Mat image;
    std::shared_ptr<const std::string> bytes = {};  // instead
  };
  static Status stored(const Job& job);
  bool offer(Job job);
  void run();
  Status failure() const;  // call with mutex_ held

  std::size_t most_queued_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Job> jobs_;
  std::size_t unwritten_ = 0;  // queued or being written
  std::optional<Error> failure_;
  bool closing_ = false;
  std::thread thread_;
};

}  // namespace limn
