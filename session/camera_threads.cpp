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
  void put(CameraOutput output) {
    newest.put(std::move(output), [this](const CameraOutput& old, CameraOutput& next) {
      for (const auto& [name, one] : old.frames) missed += !next.frames.emplace(name, one).second;
      for (const auto& [name, one] : old.detections) missed += !next.detections.emplace(name, one).second;
      next.images.insert(old.images.begin(), old.images.end());
    });
  }

  std::shared_ptr<DeviceHealth> health;
  Latest<CameraOutput> newest;
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
  std::shared_ptr<device::CameraSource> source = std::move(camera);
  Running running{source->name(), source, {}, ended.get_future()};
  running.thread =
      std::thread([camera = std::move(source), number, shared = shared_, ended = std::move(ended)]() mutable {
        grab(camera.get(), number, shared.get());
        camera.reset();  // closing the camera may take long, too
        ended.set_value();
      });
  running_.push_back(std::move(running));
}

std::optional<CameraOutput> CameraThreads::take_output(std::chrono::nanoseconds wait) {
  return shared_->newest.take_newest(wait);
}

void CameraThreads::want_images(const std::string& camera, tracker::DetectionSource::Images images) {
  for (const Running& running : running_)
    if (const auto source = running.source.lock(); source && running.camera == camera)
      if (auto* detects = dynamic_cast<tracker::DetectionSource*>(source.get())) detects->want_images(images);
}

std::size_t CameraThreads::missed() { return shared_->missed.exchange(0); }

void CameraThreads::grab(device::CameraSource* camera, std::size_t number, Shared* shared) try {
  if (auto* source = dynamic_cast<tracker::DetectionSource*>(camera)) return receive(source, number, shared);
  FrameGate gate(camera->name(), camera->size(), number, shared->health.get());
  while (!shared->is_stopping) {
    Result<Frame> sent = camera->next();
    const bool is_there = sent.ok();
    std::optional<Frame> frame = gate.taken(std::move(sent), now());
    if (!is_there) std::this_thread::sleep_for(k_retry);
    if (!frame) continue;
    if (gate.is_of_other_clock()) std::this_thread::sleep_until(frame->captured_at);
    const std::string name = frame->camera;
    shared->put({.frames = {{name, std::move(*frame)}}});
  }
} catch (const std::exception& bug) {
  shared->health->note(
      fmt::format("{}: this is a bug in Limn, please report it: {}", camera->name(), bug.what()));
}

void CameraThreads::receive(tracker::DetectionSource* camera, std::size_t number, Shared* shared) {
  while (!shared->is_stopping) {
    const auto sent = camera->next_output();
    if (!sent) shared->health->fails(number, sent.message());
    if (!sent || (!sent->detections && !sent->image)) continue;
    CameraOutput output;
    if (sent->detections) output.detections.emplace(sent->detections->camera, *sent->detections);
    if (sent->image) output.images.emplace(sent->image->camera, *sent->image);
    if (sent->detections) shared->health->works(number);
    shared->put(std::move(output));
  }
}

}  // namespace limn::session
