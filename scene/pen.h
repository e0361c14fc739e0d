#pragma once

#include <Eigen/Core>

#include "core/config.h"
#include "core/marker.h"

namespace limn::scene {

/// A marker in the hand whose tip draws lines on the prototype (`pen` of a scene.json, config/README.md).
struct Pen {
  MarkerName marker;
  double size_m = 0;                                       ///< The marker's side.
  Eigen::Vector3d p_tip_marker = Eigen::Vector3d::Zero();  ///< Where it draws, in the marker's frame, m.
};

/// Reads `pen` of a scene except its marker. Problems are recorded at the node.
Pen read_pen(const ConfigNode& node);

}  // namespace limn::scene
