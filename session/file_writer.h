#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "core/result.h"

namespace limn::apps {

/// Changes files on a thread of its own, one thing after the other in the order in which they were asked for,
/// so that nobody who draws waits for a disk. Nothing is dropped.
class FileWriter {
 public:
  FileWriter();
  ~FileWriter();  ///< does what is queued
  FileWriter(const FileWriter&) = delete;
  FileWriter& operator=(const FileWriter&) = delete;

  /// Returns at once. Jobs must not throw.
  void add(std::function<Status()> job);
  /// Whether something is not done yet.
  bool is_busy() const;
  /// Waits until all is done.
  void finish();
  /// What could not be done since the last call.
  std::vector<std::string> failures();

 private:
  void run();

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<std::function<Status()>> jobs_;  // the first one is being done
  std::vector<std::string> failures_;
  bool is_closing_ = false;
  std::thread thread_;
};

}  // namespace limn::apps
