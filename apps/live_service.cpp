#include "apps/live_service.h"

#include <algorithm>

#include "core/frame.h"

namespace limn::apps {
namespace {

constexpr double k_status_every_s = 5;

bool has_light(const session::SessionMoment& moment) {
  return std::ranges::any_of(moment.health.all(), [](const session::DeviceState& device) {
    return device.kind == "projector" && device.images > 0;
  });
}

}  // namespace

// Called in each turn of the loop, also while a recalibration uses the projectors.
void LiveService::apply_edits(const session::SessionMoment&) {
  const Stamp at = now();
  if (notifier_.watchdog_s() <= 0 || seconds_between(alive_at_, at) < notifier_.watchdog_s() / 4) return;
  if (notifier_.send("WATCHDOG=1")) alive_at_ = at;
}

void LiveService::publish_state(const session::SessionMoment& moment) {
  if (!notifier_.is_open()) return;
  if (moment.shown) ++frames_;
  if (is_ready_) return report_status();
  is_ready_ = has_light(moment) && notifier_.send("READY=1\nSTATUS=shows the first frame");
  status_at_ = now();
}

void LiveService::report_status() {
  const Stamp at = now();
  const double since_s = seconds_between(status_at_, at);
  if (since_s < k_status_every_s) return;
  if (!notifier_.send(fmt::format("STATUS={:.1f} frames per second", frames_ / since_s))) return;
  status_at_ = at;
  frames_ = 0;
}

void darken(const session::SessionDevices& devices) {
  const auto darken_all = [](const auto& displays) {
    for (const auto& display : displays)
      if (display) static_cast<void>(display->show(cv::Mat::zeros(display->size(), CV_8UC1)));
  };
  darken_all(devices.projectors);
  darken_all(devices.screens);
}

}  // namespace limn::apps
