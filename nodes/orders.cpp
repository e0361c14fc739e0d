#include "nodes/orders.h"

#include <functional>

#include "core/image_encoder.h"
#include "core/image_formats.h"
#include "core/log.h"
#include "device/devices_file.h"

namespace limn::nodes {
namespace {

constexpr double k_camera_opens_s = 8;
constexpr int k_preview_quality = 90;
constexpr double k_same_s = 1e-3;     // stamps of one image, converted there and back, differ by less
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

Status put(const Frame& frame, bool is_preview, const ClockEstimate& clock, Answer* answer) {
  answer->at = clock.to_other(frame.captured_at);
  answer->size = frame.image.size();
  if (frame.jpeg) {
    answer->image = *frame.jpeg;
    return {};
  }
  answer->image = is_preview ? encode_jpeg(frame.image, k_preview_quality) : encode_png(frame.image);
  return {};
}

Status grab(const Order& order, const ClockEstimate& clock, NodeCameras* devices, Answer* answer) {
  LIMN_TRY(device::CameraSource * camera, camera_of(order, devices));
  const Stamp begun = now(), after = clock.to_local(order.at);
  while (seconds_between(begun, now()) < k_grab_limit_s) {
    LIMN_TRY(const Frame frame, camera->next());
    if (order.at != Stamp() && frame.captured_at <= after) continue;
    return put(frame, order.what == Order::What::preview, clock, answer);
  }
  return error("{}: expected an image that was exposed after the order within {} s, found none.",
               camera->name(), k_grab_limit_s);
}

bool asks_for_image(const Order& order) {
  return order.what == Order::What::grab || order.what == Order::What::preview;
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
  return order.what == open_camera || asks_for_image(order);
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
    if (asks_for_image(order)) return clock ? grab(order, *clock, cameras, answer) : Status(no_clock());
    return unknown(order);
  });
}

Answer carried_out(const Order& order, const std::optional<ClockEstimate>& clock, DetectingCamera* camera) {
  return answer_to(order, [&](Answer* answer) -> Status {
    if (order.what == Order::What::open_camera) {
      LIMN_TRY(answer->size, camera->size(k_camera_opens_s));
      return {};
    }
    if (!asks_for_image(order)) return unknown(order);
    if (!clock) return no_clock();
    const Stamp after = order.at == Stamp() ? Stamp() : shifted(clock->to_local(order.at), k_same_s);
    LIMN_TRY(const Frame frame, camera->next_frame(after, k_grab_limit_s));
    return put(frame, order.what == Order::What::preview, *clock, answer);
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

void CameraWorker::detect(std::vector<CameraTask> tasks) {
  {
    const std::lock_guard lock(mutex_);
    tasks_ = std::move(tasks);
  }
  changed_.notify_all();
}

void CameraWorker::close_cameras() {
  {
    const std::lock_guard lock(mutex_);
    orders_.clear();
    tasks_.reset();
    is_closing_ = true;
  }
  changed_.notify_all();
}

void CameraWorker::run() {
  while (true) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return is_stopping_ || is_closing_ || tasks_ || !orders_.empty(); });
    if (is_stopping_) return;
    if (std::exchange(is_closing_, false)) {
      cameras_.close_all();
      lock.unlock();
      detecting_.clear();
      continue;
    }
    if (tasks_) {
      std::vector<CameraTask> tasks = *std::exchange(tasks_, std::nullopt);
      lock.unlock();
      begin(std::move(tasks));
      continue;
    }
    const auto [order, host] = std::move(orders_.front());
    orders_.pop_front();
    lock.unlock();
    Answer answer = answer_to(order);
    answer.to = host;
    if (const Status sent = room_->send(answer); !sent) log_warning("node: {}", sent.message());
  }
}

// A camera that goes on stays open.
void CameraWorker::begin(std::vector<CameraTask> tasks) {
  std::map<std::string, std::unique_ptr<DetectingCamera>> before = std::exchange(detecting_, {});
  std::map<std::string, CameraTask> fresh;
  for (CameraTask& task : tasks) {
    const std::string key = device::devices_text({&task.config, 1}, {});
    if (auto known = before.extract(key)) {
      known.mapped()->search_for(std::move(task.search));
      detecting_.insert(std::move(known));
    } else {
      fresh.emplace(key, std::move(task));
    }
  }
  before.clear();
  for (auto& [key, task] : fresh)
    detecting_[key] = std::make_unique<DetectingCamera>(room_, task.config, cameras_.taken_out(key),
                                                        std::move(task.search));
}

Answer CameraWorker::answer_to(const Order& order) {
  const auto clock = room_->host_clock();
  const auto wanted = devices_of(order);
  const bool is_one = wanted && wanted->cameras.size() == 1;
  const auto camera =
      is_one ? detecting_.find(device::devices_text({wanted->cameras.data(), 1}, {})) : detecting_.end();
  return camera == detecting_.end() ? carried_out(order, clock, &cameras_)
                                    : carried_out(order, clock, camera->second.get());
}

}  // namespace limn::nodes
