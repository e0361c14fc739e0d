#pragma once

#include <map>
#include <memory>
#include <opencv2/core/types.hpp>
#include <string>
#include <vector>

#include "core/result.h"
#include "device/desktop.h"
#include "device/open_camera.h"
#include "device/open_display.h"
#include "nodes/messages.h"

namespace limn::nodes {

/// The monitors of a node. A display is opened when the host first asks for it, and stays open. Use it only
/// on the main thread.
class NodeDisplays {
 public:
  /// `desktop` may be null: then only `offscreen` displays can be opened.
  explicit NodeDisplays(const device::Desktop* desktop) : desktop_(desktop) {}

  /// The monitors that are plugged in now, and `offscreen`.
  std::vector<OfferedDevice> monitors() const;
  /// The display of that configuration. Errors are those of device::open_display.
  Result<device::Display*> display(const device::DisplayConfig& config);
  /// Shows black on all displays. They stay open, because behind a projector's window is the bright desktop.
  void darken();

 private:
  const device::Desktop* desktop_;
  std::map<std::string, std::unique_ptr<device::Display>> displays_;  // by configuration
};

/// The cameras of a node, likewise. Use it on one thread.
class NodeCameras {
 public:
  /// The cameras that are plugged in or answer on the network, by their sources. Takes about a second.
  static std::vector<OfferedDevice> found();

  /// The camera of that configuration. Errors are those of open_camera_here().
  Result<device::CameraSource*> camera(const device::CameraConfig& config);
  /// The camera of that configuration if it is open; it is not kept here any more.
  std::unique_ptr<device::CameraSource> taken_out(const std::string& config);
  void close_all() { cameras_.clear(); }

 private:
  std::map<std::string, std::unique_ptr<device::CameraSource>> cameras_;  // by configuration
};

}  // namespace limn::nodes
