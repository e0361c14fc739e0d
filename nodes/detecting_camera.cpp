#include "nodes/detecting_camera.h"

#include <chrono>
#include <random>
#include <utility>

#include "core/log.h"
#include "nodes/ros_camera.h"

namespace limn::nodes {
namespace {

constexpr auto k_frame_wait = std::chrono::milliseconds(50);
constexpr auto k_open_again = std::chrono::seconds(1);

std::uint64_t random_number() {
  std::random_device random;
  return (static_cast<std::uint64_t>(random()) << 32) | random();
}

}  // namespace

struct DetectingCamera::Work {
  explicit Work(Search search)
      : setup(search.setup), detector(search.wanted, search.camera.lens, search.encoding, random_number()) {}

  std::uint64_t setup;
  tracker::CameraDetector detector;
};

DetectingCamera::DetectingCamera(Room* room,
                                 device::CameraConfig config,
                                 std::unique_ptr<device::CameraSource> source,
                                 Search search)
    : room_(room),
      config_(std::move(config)),
      source_(std::move(source)),
      next_(std::move(search)),
      thread_([this] { run(); }) {}

DetectingCamera::~DetectingCamera() {
  {
    const std::lock_guard lock(mutex_);
    is_stopping_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

void DetectingCamera::search_for(Search search) {
  const std::lock_guard lock(mutex_);
  next_ = std::move(search);
}

Error DetectingCamera::none_within(double limit_s) const {
  for (const session::DeviceState& state : health_->all())
    if (!state.works) return error("{}: {}", config_.name, state.why);
  return error("{}: expected an image within {:g} s, found none.", config_.name, limit_s);
}

Result<cv::Size> DetectingCamera::size(double limit_s) {
  std::unique_lock lock(mutex_);
  changed_.wait_for(lock, std::chrono::duration<double>(limit_s),
                    [&] { return !size_.empty() || !problem_.empty(); });
  if (!size_.empty()) return size_;
  return problem_.empty() ? none_within(limit_s) : error("{}", problem_);
}

Result<Frame> DetectingCamera::next_frame(Stamp after, double limit_s) {
  std::unique_lock lock(mutex_);
  const Stamp than = after == Stamp() ? newest_.captured_at : after;
  changed_.wait_for(lock, std::chrono::duration<double>(limit_s),
                    [&] { return newest_.captured_at > than || !problem_.empty(); });
  if (newest_.captured_at > than) return newest_;
  return problem_.empty() ? none_within(limit_s) : error("{}", problem_);
}

void DetectingCamera::run() try {
  std::unique_lock lock(mutex_);
  while (!is_stopping_) {
    lock.unlock();
    auto output = reading_ || open() ? reading_->take_output(k_frame_wait) : std::nullopt;
    if (output && !output->frames.empty()) detect(output->frames.begin()->second);
    lock.lock();
    if (!reading_) changed_.wait_for(lock, k_open_again, [&] { return is_stopping_; });
  }
} catch (const std::exception& bug) {
  log_warning("node: {}: this is a bug in Limn, please report it: {}", config_.name, bug.what());
  const std::lock_guard lock(mutex_);
  problem_ =
      fmt::format("{}: the search in its images has ended by a bug in Limn: {}", config_.name, bug.what());
  changed_.notify_all();
}

bool DetectingCamera::open() {
  std::string problem;
  if (!source_) {
    auto opened = open_camera_here(config_);
    if (opened)
      source_ = std::move(*opened);
    else
      problem = opened.message();
  }
  const std::lock_guard lock(mutex_);
  if (source_ && source_->size() != cv::Size(next_->camera.width, next_->camera.height))
    problem = fmt::format(
        "{}: expected images of {}x{} pixels, found {}x{}. Set the camera mode that the rig was calibrated "
        "with.",
        config_.name, next_->camera.width, next_->camera.height, source_->size().width,
        source_->size().height);
  if (problem.empty()) {
    size_ = source_->size();
    reading_.emplace(health_);
    reading_->add(std::move(source_), health_->add({config_.name, "camera"}));
  } else if (problem != problem_) {
    log_warning("node: {}", problem);
  }
  source_.reset();
  problem_ = problem;
  changed_.notify_all();
  return reading_.has_value();
}

void DetectingCamera::detect(const Frame& frame) {
  {
    const std::lock_guard lock(mutex_);
    newest_ = frame;
    if (reading_ && next_) work_ = std::make_unique<Work>(*std::exchange(next_, std::nullopt));
  }
  changed_.notify_all();
  const auto clock = room_->host_clock();
  Detections message{work_->setup, work_->detector.detect(frame)};
  if (!clock) return;
  message.found.captured_at = clock->to_other(frame.captured_at);
  for (tracker::GestureReading& control : message.found.controls)
    if (control.hidden_since) control.hidden_since = clock->to_other(*control.hidden_since);
  if (const Status sent = room_->send(message); !sent) log_warning("node: {}", sent.message());
}

}  // namespace limn::nodes
