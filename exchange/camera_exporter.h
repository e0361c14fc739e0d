#pragma once

#include "exchange/exporter.h"

namespace limn::exchange {

/// Write each camera and projector of the rig as NAME.yml of OpenCV, as NAME.yaml of ROS, or all as one
/// camchain of Kalibr. They need the rig alone.
Exporter opencv_camera_exporter();
Exporter ros_camera_exporter();
Exporter kalibr_exporter();

}  // namespace limn::exchange
