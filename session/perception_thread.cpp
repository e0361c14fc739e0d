#include "session/perception_thread.h"

#include <algorithm>

namespace limn::session {
namespace {

// Wait for frames before is_stopping_ is checked again.
constexpr auto k_frames_wait = std::chrono::milliseconds(50);

}  // namespace

PerceptionThread::PerceptionThread(Perception* perception,
                                   CameraThreads* cameras,
                                   Recorder* recorder,
                                   DeviceHealth* health)
    : perception_(perception), cameras_(cameras), recorder_(recorder), health_(health) {
  start();
}

Perceived PerceptionThread::take_percepts(std::chrono::nanoseconds wait) {
  Perceived out;
  if (auto seen = seen_.take_newest(wait)) {
    out.percepts = std::move(seen->percepts);
    out.moments = seen->moments;
  }
  return out;
}

void PerceptionThread::start() {
  is_stopping_ = false;
  thread_ = std::thread([this] { run(); });
}

void PerceptionThread::stop() {
  is_stopping_ = true;
  if (thread_.joinable()) thread_.join();
}

void PerceptionThread::run() try {
  while (!is_stopping_) {
    auto newest = cameras_->take_frames(k_frames_wait);
    if (!newest) continue;
    std::vector<Frame> frames;
    for (auto& [name, frame] : *newest) frames.push_back(std::move(frame));
    std::sort(frames.begin(), frames.end(),
              [](const Frame& a, const Frame& b) { return a.captured_at < b.captured_at; });
    if (recorder_) recorder_->record_frames(frames);
    seen_.put({perception_->watch(frames), ++moments_}, [](const Seen& old, Seen& next) {
      next.percepts.uses.insert(next.percepts.uses.begin(), old.percepts.uses.begin(),
                                old.percepts.uses.end());
    });
  }
} catch (const std::exception& bug) {
  health_->note(fmt::format("the tracker stopped: this is a bug in Limn, please report it: {}", bug.what()));
}

}  // namespace limn::session
