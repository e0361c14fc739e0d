#pragma once

#include <filesystem>
#include <functional>
#include <future>
#include <memory>
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

/// Fetches and loads the deviation from the CAD of a setup whose other files are here already, on a thread of
/// its own.
class DeviationLoader {
 public:
  using Layer = std::shared_ptr<const scene::DeviationLayer>;
  /// `folder`: where the file is laid out.
  DeviationLoader(FetchFiles fetch, std::filesystem::path folder)
      : fetch_(std::move(fetch)), folder_(std::move(folder)) {}
  ~DeviationLoader();

  /// Begins to load that of a setup of a host, which must have one. Nothing must be loading.
  void load(const Setup& setup, const Machine& host);
  bool is_idle() const { return !loading_.valid(); }
  /// What has been loaded since the last call, or why it could not be.
  std::optional<Result<Layer>> take_loaded();
  /// The setup that was given to load(), and the run of its host.
  const Setup& setup() const { return setup_; }
  std::uint64_t host_run() const { return host_run_; }

 private:
  FetchFiles fetch_;
  std::filesystem::path folder_;
  Setup setup_;
  std::uint64_t host_run_ = 0;
  std::future<Result<Layer>> loading_;
};

/// Whether two setups are the same but for the deviation from the CAD.
bool differ_in_deviation_only(const Setup& a, const Setup& b);

}  // namespace limn::nodes
