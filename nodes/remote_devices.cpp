#include "nodes/remote_devices.h"

#include <algorithm>
#include <chrono>

#include "core/image_encoder.h"
#include "core/image_formats.h"
#include "core/version.h"
#include "device/devices_file.h"
#include "device/jpeg.h"
#include "device/offscreen_display.h"
#include "nodes/remote_screen.h"
#include "nodes/ros_camera.h"

namespace limn::nodes {
namespace {

constexpr double k_open_limit_s = 10, k_show_limit_s = 2, k_image_limit_s = 5;
constexpr double k_most_lead_s = 0.1;
constexpr auto k_detections_wait = std::chrono::milliseconds(10),
               k_image_pause = std::chrono::milliseconds(10);
constexpr double k_output_wait_s = 0.1,
                 k_image_every_s = 0.2;  // for drift, shadows and the operator's window
// Detections that are older or come from the future are of a node whose clock is wrong.
constexpr double k_most_age_s = 2, k_ahead_s = 0.1;
constexpr double k_network_s = 0.004;  // from a description's sending to the node's drawing, for most frames

}  // namespace

Result<Machine> node_of(const Room& room, const std::string& name, const std::string& device) {
  const std::optional<Machine> node = room.find(name);
  if (!node)
    return error("{}: expected the machine {} in the room, found none. Start limn node --join there.", device,
                 name);
  if (node->offer.protocol != k_protocol)
    return error(
        "{}: expected {} with the same version as here ({}), found {}. Install the same version on both.",
        device, name, version(), node->offer.version);
  return *node;
}

Result<std::unique_ptr<RemoteDisplay>> RemoteDisplay::open(Room* room, const device::DisplayConfig& config) {
  std::unique_ptr<RemoteDisplay> out(new RemoteDisplay(room, config));
  out->size_ = config.size;
  if (!config.size.empty()) return out;
  if (const auto node = node_of(*room, config.host, config.name); !node) return node.error();
  LIMN_TRY(const Answer answer, room->ask(out->order(Order::What::open_display), k_open_limit_s));
  out->size_ = answer.size;
  return out;
}

Order RemoteDisplay::order(Order::What what) const {
  return {.to = config_.host, .what = what, .device = device::devices_text({}, {&config_, 1})};
}

Result<Stamp> RemoteDisplay::show(const cv::Mat& image) {
  LIMN_TRY_STATUS(device::check_image(image, config_.name, size_));
  Order order = this->order(Order::What::show);
  order.image = encode_png(image);
  LIMN_TRY(const Answer answer, room_->ask(std::move(order), k_show_limit_s));
  return answer.at;
}

Result<Stamp> RemoteDisplay::show_eyes(const EyeImages&) {
  LIMN_TRY(const Machine node, node_of(*room_, config_.host, config_.name));
  if (!node.health) return error("{}: expected word from {}, found none yet.", config_.name, config_.host);
  if (!node.health->problems.empty()) return error("{}: {}", config_.host, node.health->problems.front());
  // A node that draws slower than this shows its frames late. If all waited for it, it could show fewer
  // still.
  return shifted(now(),
                 std::min(k_most_lead_s, k_network_s + 1e-3 * node.health->draw_ms + node.health->latency_s));
}

Result<std::unique_ptr<RemoteCamera>> RemoteCamera::open(Room* room, const device::CameraConfig& config) {
  std::unique_ptr<RemoteCamera> out(new RemoteCamera(room, config));
  out->size_ = config.size;
  if (!config.size.empty()) return out;
  if (const auto node = node_of(*room, config.host, config.name); !node) return node.error();
  LIMN_TRY(const Answer answer, room->ask(out->order(Order::What::open_camera), k_open_limit_s));
  out->size_ = answer.size;
  return out;
}

Order RemoteCamera::order(Order::What what) const {
  return {.to = config_.host, .what = what, .device = device::devices_text({&config_, 1}, {})};
}

Result<Frame> RemoteCamera::next() { return image_by(Order::What::grab); }

Result<Frame> RemoteCamera::image_by(Order::What what) {
  Order order = this->order(what);
  order.at = captured_at_;
  LIMN_TRY(Answer answer, room_->ask(std::move(order), k_image_limit_s));
  Frame frame;
  const bool is_jpeg = answer.image.starts_with("\xff\xd8");
  if (is_jpeg) {
    LIMN_TRY(frame, device::decode_frame(std::move(answer.image)));
  } else {
    LIMN_TRY(const image_formats::StoredImage stored, image_formats::decode_png(answer.image, false));
    frame.image = stored.samples;
  }
  if (frame.image.size() != size_)
    return error("{}: expected an image of {}x{} from {}, found {}x{}.", config_.name, size_.width,
                 size_.height, config_.host, frame.image.cols, frame.image.rows);
  frame.camera = config_.name;
  frame.captured_at = captured_at_ = answer.at;
  return frame;
}

RemoteCamera::~RemoteCamera() = default;

// What can be used: of this time, inside the image, and gestures only of the scene that the session shows.
std::optional<tracker::CameraDetections> RemoteCamera::accepted(Detections received) {
  tracker::CameraDetections& found = received.found;
  const auto count = [](Stamp at) { return 1e-9 * static_cast<double>(at.time_since_epoch().count()); };
  const double age_s = count(now()) - count(found.captured_at);
  problem_.clear();
  if (age_s < -k_ahead_s || age_s > k_most_age_s)
    problem_ =
        fmt::format("{}: expected detections of now, found ones of {:.1f} s ago.", config_.name, age_s);
  if (found.captured_at <= detected_at_ || !problem_.empty()) return std::nullopt;
  detected_at_ = found.captured_at;
  if (received.setup != room_->sent_setup()) found.controls.clear();
  const auto is_outside = [&](const Eigen::Vector2d& px) {
    return px.x() < -size_.width || px.y() < -size_.height || px.x() > 2 * size_.width ||
           px.y() > 2 * size_.height;
  };
  std::erase_if(found.detections, [&](const tracker::Detection& marker) {
    return std::ranges::any_of(marker.corners_px, is_outside);
  });
  std::erase_if(found.balls, [&](const tracker::Ball& ball) { return is_outside(ball.centre_px); });
  return std::move(found);
}

Result<tracker::DetectionSource::Output> RemoteCamera::next_output() {
  if (!asking_.joinable())
    asking_ = std::jthread([this](const std::stop_token& stop) { ask_for_images(stop); });
  const Stamp end = shifted(now(), k_output_wait_s);
  while (now() < end) {
    Output out;
    if (auto received = room_->take_detections(config_.host, config_.name, k_detections_wait))
      out.detections = accepted(std::move(*received));
    if (out.detections) worked_at_ = now();
    const std::lock_guard lock(mutex_);
    out.image = std::exchange(image_, std::nullopt);
    if (out.detections || out.image) return out;
  }
  if (seconds_between(worked_at_, now()) < config_.limit_s) return Output{};
  worked_at_ = now();
  LIMN_TRY(const Machine node, node_of(*room_, config_.host, config_.name));
  if (!problem_.empty()) return error("{}", problem_);
  LIMN_TRY(const Answer answer, room_->ask(order(Order::What::open_camera), k_open_limit_s));  // it says why
  return error("{}: expected detections from {} within {:g} s, found none.", config_.name, node.sender.node,
               config_.limit_s);
}

void RemoteCamera::want_images(Images images) {
  const std::lock_guard lock(mutex_);
  if (images == Images::exact && wanted_images_ != Images::exact) image_.reset();
  wanted_images_ = images;
}

void RemoteCamera::ask_for_images(const std::stop_token& stop) {
  Stamp asked_at;
  for (; !stop.stop_requested(); std::this_thread::sleep_for(k_image_pause)) {
    while (!stop.stop_requested() &&
           (wanted_images_ != Images::some || seconds_between(asked_at, now()) >= k_image_every_s)) {
      asked_at = now();
      const bool is_exact = wanted_images_ == Images::exact;
      auto image = image_by(is_exact ? Order::What::grab : Order::What::preview);
      if (!image) break;
      const std::lock_guard lock(mutex_);
      if (!is_exact && wanted_images_ == Images::exact) continue;
      image_ = std::move(*image);
    }
  }
}

Result<std::unique_ptr<device::Display>> RoomOpener::display(const device::DisplayConfig& config) {
  if (!room_ || config.host.empty()) return local_.display(config);
  if (std::ranges::find(screens_, config.name) != screens_.end()) {
    LIMN_TRY(std::unique_ptr<device::Display> screen, RemoteScreen::open(room_, config));
    return screen;
  }
  LIMN_TRY(std::unique_ptr<device::Display> display, RemoteDisplay::open(room_, config));
  return display;
}

Result<std::unique_ptr<device::CameraSource>> RoomOpener::camera(const device::CameraConfig& config) {
  if (config.host.empty()) return open_camera_here(config);
  if (!room_) return local_.camera(config);  // says what is missing
  LIMN_TRY(std::unique_ptr<device::CameraSource> camera, RemoteCamera::open(room_, config));
  return camera;
}

}  // namespace limn::nodes
