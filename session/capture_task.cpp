#include "session/capture_task.h"

#include <fmt/format.h>

#include <filesystem>

#include "core/worker_thread.h"

namespace limn::session {
namespace {

constexpr int k_niceness = 10;  // niceness of the computation, so that drawing has priority
constexpr const char* k_ended = "the session was ended.";

}  // namespace

void CapturePort::step_back_for_drawing() { step_back(k_niceness); }

wizard::WizardBackend CapturePort::on_session_thread(wizard::WizardBackend backend) {
  wizard::WizardBackend out;
  out.capture.show = [this, show = backend.capture.show](int projector, const cv::Mat& image) {
    Status status = error("{}", k_ended);
    executor_.run([&] {
      if (is_over_) return;
      status = show(projector, image);
      ++shown_;
    });
    return status;
  };
  out.capture.grab = [this, grab = backend.capture.grab](int camera) {
    Result<cv::Mat> image = error("{}", k_ended);
    executor_.run([&] {
      if (!is_over_) image = grab(camera);
    });
    return image;
  };
  out.capture.store = backend.capture.store;
  out.use_latency = [this, use = backend.use_latency](int projector, double seconds) {
    executor_.run([&] { use(projector, seconds); });
  };
  out.wait_for_files = [this, written = backend.wait_for_files] {
    Status status = written();
    step_back_for_drawing();
    end_capturing();
    return status;
  };
  return out;
}

std::string CapturePort::words() const {
  return is_capturing_ ? fmt::format("{} of {} patterns", shown_.load(), images_) : "computing";
}

}  // namespace limn::session
