#pragma once

#include <vector>

#include "device/devices_file.h"
#include "device/file_lock.h"

namespace limn::device {

/// Locks the devices file and this machine's monitors in it, so that no second session shows on them. The
/// locks are in $XDG_RUNTIME_DIR/limn, /run/user/UID/limn or a folder for temporary files. Error: a session
/// uses one, or the folder cannot be made.
Result<std::vector<FileLock>> lock_devices(const device::Devices& devices);

}  // namespace limn::device
