#include "nodes/orders.h"

#include <functional>

#include "core/image_encoder.h"
#include "core/image_formats.h"
#include "core/log.h"
#include "device/devices_file.h"

namespace limn::nodes {
namespace {

constexpr double k_grab_limit_s = 4;  // for an image that was exposed after a given moment

Result<device::Devices> devices_of(const Order& order) {
  return device::parse_devices(order.device, "the host's order", {});
}

Result<device::Display*> display_of(const Order& order, NodeDisplays* devices) {
  LIMN_TRY(const device::Devices wanted, devices_of(order));
  if (wanted.displays.size() != 1)
    return error("expected one display in the order, found {}.", wanted.displays.size());
  return devices->display(wanted.displays[0]);
}

Result<device::CameraSource*> camera_of(const Order& order, NodeCameras* devices) {
  LIMN_TRY(const device::Devices wanted, devices_of(order));
  if (wanted.cameras.size() != 1)
    return error("expected one camera in the order, found {}.", wanted.cameras.size());
  return devices->camera(wanted.cameras[0]);
}

Status open_display(const Order& order, NodeDisplays* devices, Answer* answer) {
  LIMN_TRY(const device::Display* display, display_of(order, devices));
  answer->size = display->size();
  return {};
}

Status show(const Order& order,
            const cv::Mat& image,
            const ClockEstimate& clock,
            NodeDisplays* devices,
            Answer* answer) {
  LIMN_TRY(device::Display * display, display_of(order, devices));
  if (image.empty())
    return error("expected a PNG image to show, found {} bytes of something else.", order.image.size());
  LIMN_TRY(const Stamp shown_at, display->show(image));
  answer->at = clock.to_other(shown_at);
  return {};
}

Status open_camera(const Order& order, NodeCameras* devices, Answer* answer) {
  LIMN_TRY(const device::CameraSource* camera, camera_of(order, devices));
  answer->size = camera->size();
  return {};
}

Status grab(const Order& order, const ClockEstimate& clock, NodeCameras* devices, Answer* answer) {
  LIMN_TRY(device::CameraSource * camera, camera_of(order, devices));
  const Stamp begun = now(), after = clock.to_local(order.at);
  while (seconds_between(begun, now()) < k_grab_limit_s) {
    LIMN_TRY(const Frame frame, camera->next());
    if (order.at != Stamp() && frame.captured_at <= after) continue;
    answer->at = clock.to_other(frame.captured_at);
    answer->size = frame.image.size();
    if (frame.jpeg) {
      answer->image = *frame.jpeg;
      return {};
    }
    answer->image = encode_png(frame.image);
    return {};
  }
  return error("{}: expected an image that was exposed after the order within {} s, found none.",
               camera->name(), k_grab_limit_s);
}

Error no_clock() {
  return error("expected that the clocks are compared, found no answer from the host yet.");
}
Error unknown(const Order& order) {
  return error("expected an order that this version knows, found number {}.", static_cast<int>(order.what));
}

Answer answer_to(const Order& order, const std::function<Status(Answer*)>& carry_out) {
  Answer answer{.number = order.number};
  if (const Status done = carry_out(&answer); !done) answer.error = done.message();
  return answer;
}

}  // namespace

bool is_for_camera(const Order& order) {
  using enum Order::What;
  return order.what == open_camera || order.what == grab;
}

cv::Mat image_of(const Order& order) {
  const auto image = image_formats::decode_png(order.image, false);
  return image ? image->samples : cv::Mat();
}

Answer carried_out(const Order& order,
                   const cv::Mat& image,
                   const std::optional<ClockEstimate>& clock,
                   NodeDisplays* displays) {
  return answer_to(order, [&](Answer* answer) -> Status {
    if (order.what == Order::What::open_display) return open_display(order, displays, answer);
    if (order.what == Order::What::show)
      return clock ? show(order, image, *clock, displays, answer) : Status(no_clock());
    return unknown(order);
  });
}

Answer carried_out(const Order& order, const std::optional<ClockEstimate>& clock, NodeCameras* cameras) {
  return answer_to(order, [&](Answer* answer) -> Status {
    if (order.what == Order::What::open_camera) return open_camera(order, cameras, answer);
    if (order.what == Order::What::grab)
      return clock ? grab(order, *clock, cameras, answer) : Status(no_clock());
    return unknown(order);
  });
}

CameraWorker::~CameraWorker() {
  {
    const std::lock_guard lock(mutex_);
    is_stopping_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

void CameraWorker::carry_out(Order order, const std::string& host) {
  {
    const std::lock_guard lock(mutex_);
    orders_.emplace_back(std::move(order), host);
  }
  changed_.notify_all();
}

void CameraWorker::close_cameras() {
  {
    const std::lock_guard lock(mutex_);
    orders_.clear();
    is_closing_ = true;
  }
  changed_.notify_all();
}

void CameraWorker::run() {
  while (true) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return is_stopping_ || is_closing_ || !orders_.empty(); });
    if (is_stopping_) return;
    if (std::exchange(is_closing_, false)) cameras_.close_all();
    if (orders_.empty()) continue;
    const auto [order, host] = std::move(orders_.front());
    orders_.pop_front();
    lock.unlock();
    Answer answer = carried_out(order, room_->host_clock(), &cameras_);
    answer.to = host;
    if (const Status sent = room_->send(answer); !sent) log_warning("node: {}", sent.message());
  }
}

}  // namespace limn::nodes
