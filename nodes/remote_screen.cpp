#include "nodes/remote_screen.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include "device/devices_file.h"
#include "device/jpeg.h"
#include "device/offscreen_display.h"
#include "nodes/remote_devices.h"

namespace limn::nodes {
namespace {

constexpr double k_ask_limit_s = 10;
constexpr double k_shortest_pause_s = 1.0 / 15;  // between two images
constexpr double k_bytes_a_second = 4e6;         // about a third of a network of 100 Mbit/s
constexpr int k_jpeg_quality = 85;
constexpr double k_delay_s = 0.05;  // what encoding, network and decoding mostly take

std::string jpeg_of(const cv::Mat& image) {
  if (image.empty()) return {};
  const std::vector<std::uint8_t> bytes = device::encode_jpeg(image, k_jpeg_quality);
  return {bytes.begin(), bytes.end()};
}

}  // namespace

device::DisplayConfig screen_at_node(device::DisplayConfig config) {
  config.vsync = false;
  return config;
}

RemoteScreen::RemoteScreen(Room* room, const device::DisplayConfig& config)
    : room_(room), config_(screen_at_node(config)), size_(config.size), thread_([this] { run(); }) {}

RemoteScreen::~RemoteScreen() {
  {
    const std::lock_guard lock(mutex_);
    is_stopping_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

Result<std::unique_ptr<RemoteScreen>> RemoteScreen::open(Room* room, const device::DisplayConfig& config) {
  std::unique_ptr<RemoteScreen> out(new RemoteScreen(room, config));
  if (!config.size.empty()) return out;
  if (const auto node = node_of(*room, config.host, config.name); !node) return node.error();
  Order order{.to = config.host,
              .what = Order::What::open_display,
              .device = device::devices_text({}, {&out->config_, 1})};
  LIMN_TRY(const Answer answer, room->ask(std::move(order), k_ask_limit_s));
  out->size_ = answer.size;
  return out;
}

Result<Stamp> RemoteScreen::show_eyes(const EyeImages& images) {
  LIMN_TRY_STATUS(device::check_image(images.left, config_.name, size_));
  if (images.is_stereo()) LIMN_TRY_STATUS(device::check_image(images.right, config_.name, size_));
  LIMN_TRY(const Machine node, node_of(*room_, config_.host, config_.name));
  hand_over(images);  // even if the last one could not be shown: perhaps this one can
  if (node.health)
    for (const std::string& problem : node.health->screen_problems)
      if (problem.starts_with(config_.name + ":")) return error("{}: {}", config_.host, problem);
  const std::lock_guard lock(mutex_);
  if (!problem_.empty()) return error("{}", problem_);
  return shifted(now(), k_delay_s);
}

void RemoteScreen::hand_over(const EyeImages& images) {
  {
    const std::lock_guard lock(mutex_);
    // A session has a new image in each frame, so that none is missed that is left out here.
    if (is_sending_ || now() < due_at_) return;
    waiting_ = EyeImages{images.left.clone(), images.right.clone()};
  }
  changed_.notify_all();
}

void RemoteScreen::run() {
  std::unique_lock lock(mutex_);
  while (true) {
    changed_.wait(lock, [this] { return is_stopping_ || waiting_; });
    if (is_stopping_) return;
    const EyeImages images = *std::exchange(waiting_, std::nullopt);
    is_sending_ = true;
    lock.unlock();
    const Stamp begun = now();
    double seconds = k_shortest_pause_s;
    const Status sent = send(images, &seconds);
    lock.lock();
    is_sending_ = false;
    due_at_ = shifted(begun, seconds);
    problem_ = sent ? std::string() : sent.message();
  }
}

// `seconds`: for how long the network shall get nothing more.
Status RemoteScreen::send(const EyeImages& images, double* seconds) {
  const ScreenImage image{.to = config_.host,
                          .screen = config_.name,
                          .number = ++sent_,
                          .left = jpeg_of(images.left),
                          .right = jpeg_of(images.right)};
  const auto bytes = static_cast<double>(image.left.size() + image.right.size());
  *seconds = std::max(k_shortest_pause_s, bytes / k_bytes_a_second);
  return room_->send(image);
}

}  // namespace limn::nodes
