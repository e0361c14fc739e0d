#include "device/device_locks.h"

#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cstdlib>

namespace limn::device {
namespace {

namespace fs = std::filesystem;

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

Result<std::vector<FileLock>> lock_devices(const Devices& devices) {
  const fs::path folder = lock_folder();
  std::error_code no_path;
  const fs::path file = fs::weakly_canonical(devices.file, no_path);
  std::vector<FileLock> locks;
  LIMN_TRY(FileLock of_file,
           FileLock::acquire(folder / file_name("devices" + file.string()), devices.file.string()));
  locks.push_back(std::move(of_file));
  const char* const desktop = std::getenv("DISPLAY");
  for (const DisplayConfig& display : devices.displays) {
    if (!display.host.empty() || display.kind != DisplayKind::monitor) continue;
    const std::string name = fmt::format("monitor{}-{}", desktop ? desktop : "", display.monitor);
    LIMN_TRY(FileLock of_monitor, FileLock::acquire(folder / file_name(name),
                                                    fmt::format("{}: displays: the monitor {}",
                                                                devices.file.string(), display.monitor)));
    locks.push_back(std::move(of_monitor));
  }
  return locks;
}

}  // namespace limn::device
