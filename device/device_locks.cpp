#include "device/device_locks.h"

#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <functional>
#include <system_error>

namespace limn::device {
namespace {

namespace fs = std::filesystem;

Result<fs::path> lock_folder() {
  const char* const runtime = std::getenv("XDG_RUNTIME_DIR");
  if (runtime && fs::path(runtime).is_absolute()) return fs::path(runtime) / "limn";
  std::error_code problem;
  // A service has the variable, a session from cron or su has not: both must find the same locks.
  if (const fs::path usual = fmt::format("/run/user/{}", getuid()); fs::is_directory(usual, problem))
    return usual / "limn";
  const fs::path folder = fs::temp_directory_path(problem);
  if (!problem) return folder / fmt::format("limn-{}", getuid());
  return error("TMPDIR: expected a folder for temporary files, found: {}. Make it, or set TMPDIR to another.",
               problem.message());
}

// The hash of what is locked, which may be longer than a file's name and may hold any characters.
std::string file_name(const std::string& locked) {
  return fmt::format("{:016x}.lock", std::hash<std::string>()(locked));
}

// In a folder for temporary files another user may have made the folder.
Status check_own(const fs::path& folder) {
  std::error_code missing;  // then mkdir() fails
  fs::create_directories(folder.parent_path(), missing);
  if (mkdir(folder.c_str(), 0700) == 0) return {};
  const int problem = errno;
  struct stat found {};
  if (lstat(folder.c_str(), &found) != 0)
    return error(
        "{}: expected to make this folder for the locks of devices, found: {}. Unset XDG_RUNTIME_DIR, or set "
        "it to a folder of this user.",
        folder.string(), std::generic_category().message(problem));
  if (!S_ISDIR(found.st_mode) || found.st_uid != getuid() || (found.st_mode & 022) != 0)
    return error(
        "{}: expected a folder that only this user can write, found another. Set XDG_RUNTIME_DIR to one.",
        folder.string());
  return {};
}

}  // namespace

Result<std::vector<FileLock>> lock_devices(const Devices& devices) {
  LIMN_TRY(const fs::path folder, lock_folder());
  LIMN_TRY_STATUS(check_own(folder));
  std::vector<FileLock> locks;
  if (!devices.file.empty()) {  // without it the devices are what a room offers
    std::error_code no_path;
    const fs::path file = fs::weakly_canonical(devices.file, no_path);
    LIMN_TRY(FileLock of_file,
             FileLock::acquire(folder / file_name("devices " + file.string()), devices.file.string()));
    locks.push_back(std::move(of_file));
  }
  const char* const desktop = std::getenv("DISPLAY");
  for (const DisplayConfig& display : devices.displays) {
    if (!display.host.empty() || display.kind != DisplayKind::monitor) continue;
    const std::string name = fmt::format("monitor {} {}", desktop ? desktop : "", display.monitor);
    LIMN_TRY(FileLock of_monitor, FileLock::acquire(folder / file_name(name),
                                                    fmt::format("{}: displays: the monitor {}",
                                                                devices.file.string(), display.monitor)));
    locks.push_back(std::move(of_monitor));
  }
  return locks;
}

}  // namespace limn::device
