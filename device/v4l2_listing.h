#pragma once

#include <string>
#include <vector>

#include "device/v4l2_camera.h"

namespace limn::device {

/// A kind of image that a camera offers.
struct V4l2Mode {
  std::string format;              ///< four letters, such as MJPG
  int width = 0, height = 0;       ///< pixels
  std::vector<double> rates = {};  ///< frames per second; empty: the driver does not list them
};

/// A control of a camera, as the driver reports it.
struct V4l2Control {
  std::string name;
  int value = 0, minimum = 0, maximum = 0, default_value = 0;
};

struct V4l2Listing {
  std::vector<V4l2Mode> modes;  ///< in the driver's order; sizes and rates that come in steps are left out
  std::vector<V4l2Control> controls;  ///< those that have a number as their value and are not switched off
};

/// What the camera at `path` offers. Nothing is changed. Error: it cannot be opened.
Result<V4l2Listing> v4l2_listing(const std::string& path, const V4l2System& system = V4l2System::kernel());

}  // namespace limn::device
