#include "nodes/remote_devices.h"

#include <algorithm>

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

Result<Frame> RemoteCamera::next() {
  Order order = this->order(Order::What::grab);
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
