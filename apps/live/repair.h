#pragma once

#include <atomic>
#include <filesystem>

#include "apps/calibrate.h"
#include "apps/live/session.h"
#include "apps/live/telemetry.h"
#include "apps/live/watcher.h"

namespace limn::apps {

/// Where mended rigs of a session go: a new folder in `out`, in Limn's own folder without one.
Result<std::filesystem::path> repair_folder(const std::filesystem::path& out);

/// The rig of a running session is checked by the prototype as it stands (apps/recheck.h), with the session's
/// own devices: `around` needs stage, written and use_latency. Where one device has moved, watcher and
/// session go on with the mended rig, which is in `folder` for the next session; what could not be done is
/// told, and the session goes on as it was. Nobody may use the watcher meanwhile.
void repair(const Surroundings& around,
            const std::filesystem::path& folder,
            Stamp at,
            Watcher* watcher,
            Session* session);

}  // namespace limn::apps
