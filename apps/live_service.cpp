#include "apps/live_service.h"

#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cstdlib>

#include "core/frame.h"

namespace limn::apps {
namespace {

namespace fs = std::filesystem;

constexpr double k_status_every_s = 5;

fs::path lock_folder() {
  const char* const runtime = std::getenv("XDG_RUNTIME_DIR");
  if (runtime && fs::path(runtime).is_absolute()) return fs::path(runtime) / "limn";
  return fs::temp_directory_path() / fmt::format("limn-{}", getuid());
}

// Other characters become "_", so that the name is a file's name.
std::string file_name(std::string name) {
  std::ranges::replace_if(
      name, [](unsigned char c) { return !std::isalnum(c) && c != '-' && c != '.'; }, '_');
  return name + ".lock";
}

}  // namespace

// Called in each turn of the loop, also while a recalibration uses the projectors.
void LiveService::apply_edits(const session::SessionMoment&) {
  const Stamp at = now();
  if (notifier_.watchdog_s() <= 0 || seconds_between(alive_at_, at) < notifier_.watchdog_s() / 4) return;
  alive_at_ = at;
  notifier_.send("WATCHDOG=1");
}

void LiveService::publish_state(const session::SessionMoment& moment) {
  if (!notifier_.is_open()) return;
  if (moment.shown) ++frames_;
  if (!is_ready_) notifier_.send("READY=1");
  is_ready_ = true;
  report_status();
}

void LiveService::report_status() {
  const Stamp at = now();
  const double since_s = seconds_between(status_at_, at);
  if (since_s < k_status_every_s) return;
  notifier_.send(status_at_ == Stamp{} ? std::string("STATUS=shows the first frame")
                                       : fmt::format("STATUS={:.1f} frames per second", frames_ / since_s));
  status_at_ = at;
  frames_ = 0;
}

Result<std::vector<FileLock>> lock_devices(const device::Devices& devices) {
  const fs::path folder = lock_folder();
  std::error_code no_path;
  const fs::path file = fs::weakly_canonical(devices.file, no_path);
  std::vector<FileLock> locks;
  LIMN_TRY(FileLock of_file,
           FileLock::acquire(folder / file_name("devices" + file.string()), devices.file.string()));
  locks.push_back(std::move(of_file));
  const char* const desktop = std::getenv("DISPLAY");
  for (const device::DisplayConfig& display : devices.displays) {
    if (!display.host.empty() || display.kind != device::DisplayKind::monitor) continue;
    const std::string name = fmt::format("monitor{}-{}", desktop ? desktop : "", display.monitor);
    LIMN_TRY(FileLock of_monitor, FileLock::acquire(folder / file_name(name),
                                                    fmt::format("{}: displays: the monitor {}",
                                                                devices.file.string(), display.monitor)));
    locks.push_back(std::move(of_monitor));
  }
  return locks;
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
