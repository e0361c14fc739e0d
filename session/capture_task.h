#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <future>
#include <optional>
#include <string>
#include <utility>

#include "core/image_writer.h"
#include "core/result.h"
#include "wizard/capture/backend.h"
#include "wizard/capture/main_thread_executor.h"

namespace limn::session {

/// The device functions of a session for a computation on another thread: serve() executes them on the
/// session's thread, which can respond to people in between.
class CapturePort {
 public:
  /// `images`: the number of images that will be shown; 0: no devices are used.
  explicit CapturePort(int images) : images_(images), is_capturing_(images > 0) {}

  /// The same functions, executed by serve(). After the last photograph (wait_for_files) the calling thread
  /// gets a low priority and is_capturing() is false. After end() they return errors.
  wizard::WizardBackend on_session_thread(wizard::WizardBackend backend);
  /// Executes a device call that is pending or comes within `wait`.
  void serve(std::chrono::nanoseconds wait = {}) { executor_.serve(wait); }
  /// Whether the devices are still used.
  bool is_capturing() const { return is_capturing_; }
  void end_capturing() { is_capturing_ = false; }
  void end() { is_over_ = true; }
  bool is_over() const { return is_over_; }
  /// The progress in words: "12 of 44 patterns", "computing".
  std::string words() const;
  /// Lowers the priority of the calling thread, so that drawing comes first.
  static void step_back_for_drawing();

 private:
  int images_;
  std::atomic<int> shown_ = 0;
  std::atomic<bool> is_capturing_, is_over_ = false;
  wizard::MainThreadExecutor executor_;
};

/// A computation on a thread of its own that begins with captures by the session's devices. After the last
/// photograph the session may show frames again while the result is computed with low priority.
template <typename T>
class CaptureTask {
 public:
  using Backend = std::function<wizard::WizardBackend(ImageWriter*)>;
  using ShouldContinue = std::function<bool()>;
  using Work = std::function<Result<T>(const wizard::WizardBackend&, const ShouldContinue&)>;

  /// `backend` must set capture, wait_for_files and use_latency; its images go to the writer that it is
  /// given. Empty, and `images` 0: the work uses no devices.
  CaptureTask(int images, const Backend& backend, Work work) : port_(images) {
    wizard::WizardBackend devices;
    if (backend) devices = port_.on_session_thread(backend(&writer_));
    result_ = std::async(std::launch::async,
                         [this, devices = std::move(devices), work = std::move(work)]() -> Result<T> {
                           if (!port_.is_capturing()) CapturePort::step_back_for_drawing();
                           try {
                             return work(devices, [this] { return !port_.is_over(); });
                           } catch (const std::exception& bug) {
                             return error("this is a bug in Limn, please report it: {}", bug.what());
                           }
                         });
  }
  /// Cancels the work; this takes a second at most.
  ~CaptureTask() {
    constexpr auto k_check_again = std::chrono::milliseconds(5);
    port_.end();
    while (result_.valid() && result_.wait_for(k_check_again) != std::future_status::ready) port_.serve();
  }
  CaptureTask(const CaptureTask&) = delete;
  CaptureTask& operator=(const CaptureTask&) = delete;

  CapturePort& port() { return port_; }
  const CapturePort& port() const { return port_; }
  /// Whether the result can be had at once.
  bool is_done() const {
    return !result_.valid() || result_.wait_for(std::chrono::seconds(0)) == std::future_status::ready;
  }
  /// The result when it is finished, once; otherwise nullopt.
  std::optional<Result<T>> take_result() {
    if (!result_.valid() || !is_done()) return std::nullopt;
    port_.end_capturing();
    return result_.get();
  }

 private:
  CapturePort port_;
  ImageWriter writer_;
  std::future<Result<T>> result_;
};

}  // namespace limn::session
