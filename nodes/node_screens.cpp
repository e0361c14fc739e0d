#include "nodes/node_screens.h"

#include <cmath>
#include <utility>

#include "core/log.h"
#include "core/names.h"
#include "device/jpeg.h"
#include "nodes/remote_screen.h"

namespace limn::nodes {
namespace {

constexpr double k_retry_s = 1;

Result<cv::Mat> decoded(const std::string& jpeg) {
  return device::decode_jpeg({reinterpret_cast<const std::uint8_t*>(jpeg.data()), jpeg.size()});
}

Result<EyeImages> decoded(const ScreenImage& image) {
  EyeImages out;
  LIMN_TRY(out.left, decoded(image.left));
  if (image.right.empty()) return out;
  LIMN_TRY(out.right, decoded(image.right));
  return out;
}

}  // namespace

NodeScreens::~NodeScreens() {
  {
    const std::lock_guard lock(mutex_);
    is_stopping_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

void NodeScreens::set_devices(const device::Devices& devices, const Rig& rig, const std::string& node) {
  screens_.clear();
  problems_.clear();
  for (const device::DisplayConfig& display : devices.displays)
    if (display.host == node && !find_named(rig.projectors, display.name))
      screens_[display.name] = screen_at_node(display);
}

void NodeScreens::receive(std::vector<ScreenImage> images) {
  if (images.empty()) return;
  {
    const std::lock_guard lock(mutex_);
    for (ScreenImage& image : images) waiting_[image.screen] = std::move(image);
  }
  changed_.notify_all();
}

void NodeScreens::run() {
  std::unique_lock lock(mutex_);
  while (true) {
    changed_.wait(lock, [this] { return is_stopping_ || !waiting_.empty(); });
    if (is_stopping_) return;
    const auto first = waiting_.extract(waiting_.begin());
    const std::uint64_t clearings = clearings_;
    lock.unlock();
    Result<EyeImages> images = decoded(first.mapped());
    lock.lock();
    if (clearings != clearings_) continue;
    decoded_.erase(first.key());
    decoded_.emplace(first.key(), std::move(images));
  }
}

Status NodeScreens::show(const device::DisplayConfig& screen, const Result<EyeImages>& image) {
  if (!image) return error("{}: its image: {}", screen.name, image.message());
  LIMN_TRY(device::Display * display, displays_->display(screen));
  const Result<Stamp> shown_at = display->show_eyes(*image);
  return shown_at ? Status() : Status(shown_at.error());
}

void NodeScreens::show() {
  std::map<std::string, Result<EyeImages>> images;
  {
    const std::lock_guard lock(mutex_);
    images.swap(decoded_);
  }
  for (const auto& [name, image] : images) {
    const auto screen = screens_.find(name);
    if (screen == screens_.end()) continue;  // its setup is not loaded yet
    const auto before = problems_.find(name);
    if (before != problems_.end() && std::abs(seconds_between(before->second.since, now())) < k_retry_s)
      continue;
    const Status shown = show(screen->second, image);
    if (shown) {
      problems_.erase(name);
      if (shown_.insert(name).second) log_info("node: {} shows the host's images", name);
      continue;
    }
    std::string problem = shown.message();
    if (!problem.starts_with(name + ":")) problem.insert(0, name + ": ");
    if (before == problems_.end() || before->second.text != problem) log_warning("node: {}", problem);
    problems_[name] = {std::move(problem), now()};
  }
}

void NodeScreens::clear() {
  const std::lock_guard lock(mutex_);
  waiting_.clear();
  decoded_.clear();
  ++clearings_;
}

void NodeScreens::report(Health* health) const {
  for (const auto& [screen, problem] : problems_) health->screen_problems.push_back(problem.text);
}

}  // namespace limn::nodes
