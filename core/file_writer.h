#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "core/result.h"

namespace limn {

/// Runs file changes on a thread of its own, one after the other in the order of add(), so that the render
/// thread never waits for the disk. Nothing is dropped.
class FileWriter {
 public:
  FileWriter();
  ~FileWriter();  ///< finishes the queued jobs
  FileWriter(const FileWriter&) = delete;
  FileWriter& operator=(const FileWriter&) = delete;

  /// Returns at once. Jobs must not throw.
  void add(std::function<Status()> job);
  /// Whether some jobs are not finished yet.
  bool is_busy() const;
  /// Waits until all jobs are finished.
  void finish();
  /// Messages of the jobs that failed since the last call.
  std::vector<std::string> failures();

 private:
  void run();

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<std::function<Status()>> jobs_;  // the first one is running
  std::vector<std::string> failures_;
  bool is_closing_ = false;
  std::thread thread_;
};

}  // namespace limn
