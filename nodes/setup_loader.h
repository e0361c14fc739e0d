#pragma once

#include <filesystem>
#include <functional>
#include <future>
#include <optional>
#include <string>

#include "core/result.h"
#include "device/devices_file.h"
#include "nodes/file_offer.h"
#include "nodes/messages.h"
#include "nodes/room.h"
#include "session/recording.h"

namespace limn::nodes {

/// A setup whose files are on this machine.
struct LoadedSetup {
  std::uint64_t run = 0;       ///< the host's run that it came from
  std::uint64_t revision = 0;  ///< Setup::revision
  session::SessionSetup session = {};
  device::Devices devices = {};  ///< the displays and cameras that are plugged into nodes
};

/// Fetches and loads setups on a thread of its own, the newest first.
class SetupLoader {
 public:
  /// `folder`: where setups are laid out, each in a folder of its own; older ones are removed.
  SetupLoader(FetchFiles fetch, std::filesystem::path folder)
      : fetch_(std::move(fetch)), folder_(std::move(folder)) {}
  ~SetupLoader();

  /// Begins to load a setup of a host. One that is being loaded is finished before.
  void load(const Setup& setup, const Machine& host);
  /// Whether nothing is being loaded, and take_loaded() has given what was.
  bool is_idle() const { return !loading_.valid(); }
  /// The newest setup that was loaded since the last call, or the error why it could not be.
  std::optional<Result<LoadedSetup>> take_loaded();

 private:
  struct Wanted {
    Setup setup;
    Machine host;
  };
  static Result<LoadedSetup> loaded(const FetchFiles& fetch,
                                    const Wanted& wanted,
                                    const std::filesystem::path& folder);
  void begin_next();

  FetchFiles fetch_;
  std::filesystem::path folder_;
  int folders_ = 0;
  std::optional<Wanted> next_;
  std::future<Result<LoadedSetup>> loading_;
};

}  // namespace limn::nodes
