#include "session/camera_threads.h"

#include <atomic>

#include "core/latest.h"
#include "core/log.h"
#include "session/frame_gate.h"

namespace limn::session {
namespace {

constexpr auto k_retry = std::chrono::milliseconds(100);

}  // namespace

struct CameraThreads::Shared {
  std::shared_ptr<DeviceHealth> health;
  Latest<Frames> frames;
  std::atomic<bool> is_stopping = false;
  std::atomic<std::size_t> missed = 0;
};

CameraThreads::CameraThreads(std::shared_ptr<DeviceHealth> health) : shared_(std::make_shared<Shared>()) {
  shared_->health = std::move(health);
}

CameraThreads::~CameraThreads() {
  shared_->is_stopping = true;
  const auto deadline = std::chrono::steady_clock::now() + k_patience;
  for (Running& running : running_) {
    if (running.ended.wait_until(deadline) == std::future_status::ready) {
      running.thread.join();
      continue;
    }
    running.thread.detach();
    log_warning("live: the driver of {} does not respond; the session ends without closing this camera.",
                running.camera);
  }
}

void CameraThreads::add(std::unique_ptr<device::CameraSource> camera, std::size_t number) {
  std::promise<void> ended;
  Running running{camera->name(), {}, ended.get_future()};
  running.thread =
      std::thread([camera = std::move(camera), number, shared = shared_, ended = std::move(ended)]() mutable {
        grab(camera.get(), number, shared.get());
        camera.reset();  // closing the camera may take long, too
        ended.set_value();
      });
  running_.push_back(std::move(running));
}

std::optional<Frames> CameraThreads::take_frames(std::chrono::nanoseconds wait) {
  return shared_->frames.take_newest(wait);
}

std::size_t CameraThreads::missed() { return shared_->missed.exchange(0); }

void CameraThreads::grab(device::CameraSource* camera, std::size_t number, Shared* shared) try {
  FrameGate gate(camera->name(), camera->size(), number, shared->health.get());
  while (!shared->is_stopping) {
    Result<Frame> sent = camera->next();
    const bool is_there = sent.ok();
    std::optional<Frame> frame = gate.taken(std::move(sent), now());
    if (!is_there) std::this_thread::sleep_for(k_retry);
    if (!frame) continue;
    if (gate.is_of_other_clock()) std::this_thread::sleep_until(frame->captured_at);
    Frames frames;
    frames.emplace(frame->camera, std::move(*frame));
    shared->frames.put(std::move(frames), [shared](const Frames& old, Frames& newest) {
      for (const auto& [name, frame] : old) shared->missed += !newest.emplace(name, frame).second;
    });
  }
} catch (const std::exception& bug) {
  shared->health->note(
      fmt::format("{}: this is a bug in Limn, please report it: {}", camera->name(), bug.what()));
}

}  // namespace limn::session
