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
                                   PoseFeeds* feeds,
                                   DeviceHealth* health)
    : perception_(perception), cameras_(cameras), recorder_(recorder), feeds_(feeds), health_(health) {
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
    auto newest = cameras_->take_output(k_frames_wait);
    FeedInput input = feeds_ ? feeds_->received(now(), true) : FeedInput();
    if (!newest && input.is_empty()) continue;
    std::vector<Frame> frames;
    if (newest) {
      for (auto& [name, frame] : newest->frames) frames.push_back(std::move(frame));
      for (auto& [name, image] : newest->images) input.images.push_back(std::move(image));
      for (auto& [name, found] : newest->detections) input.detections.push_back(std::move(found));
    }
    std::sort(frames.begin(), frames.end(),
              [](const Frame& a, const Frame& b) { return a.captured_at < b.captured_at; });
    if (recorder_) recorder_->record_frames(frames, input);
    seen_.put({perception_->watch(frames, input), ++moments_}, [](const Seen& old, Seen& next) {
      next.percepts.uses.insert(next.percepts.uses.begin(), old.percepts.uses.begin(),
                                old.percepts.uses.end());
      next.percepts.feed_notes.insert(next.percepts.feed_notes.begin(), old.percepts.feed_notes.begin(),
                                      old.percepts.feed_notes.end());
    });
  }
} catch (const std::exception& bug) {
  health_->note(fmt::format("the tracker stopped: this is a bug in Limn, please report it: {}", bug.what()));
}

}  // namespace limn::session
