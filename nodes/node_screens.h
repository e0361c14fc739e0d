#pragma once

#include <condition_variable>
#include <map>
#include <mutex>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "core/result.h"
#include "core/rig.h"
#include "core/stereo.h"
#include "device/devices_file.h"
#include "nodes/messages.h"
#include "nodes/node_devices.h"

namespace limn::nodes {

/// The screens of a session that are plugged into this node. Their images come from the host; a thread of
/// this object decodes them. All functions are for the main thread, and none waits for it.
class NodeScreens {
 public:
  explicit NodeScreens(NodeDisplays* displays) : displays_(displays), thread_([this] { run(); }) {}
  ~NodeScreens();

  /// The session's devices: the screens are the displays of `node` that are no projectors of the rig.
  void set_devices(const device::Devices& devices, const Rig& rig, const std::string& node);
  /// Takes images to decode; the newest of each screen wins.
  void receive(std::vector<ScreenImage> images);
  /// Shows what has been decoded since the last call. A screen that fails is a problem, and is tried again
  /// with an image one second later, since opening it takes time that the projectors need.
  void show();
  /// Drops all images that are not shown yet.
  void clear();
  /// Adds the problems.
  void report(Health* health) const;

 private:
  struct Problem {
    std::string text;
    Stamp since;
  };
  void run();
  Status show(const device::DisplayConfig& screen, const Result<EyeImages>& image);

  NodeDisplays* displays_;
  std::map<std::string, device::DisplayConfig> screens_;  // by name
  std::map<std::string, Problem> problems_;               // by screen
  std::set<std::string> shown_;                           // screens that have shown an image
  std::mutex mutex_;
  std::condition_variable changed_;
  std::map<std::string, ScreenImage> waiting_;
  std::map<std::string, Result<EyeImages>> decoded_;
  std::uint64_t clearings_ = 0;  // an image that was taken before one is not shown
  bool is_stopping_ = false;
  std::thread thread_;
};

}  // namespace limn::nodes
