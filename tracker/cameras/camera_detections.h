#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "core/frame.h"
#include "tracker/balls/ball.h"
#include "tracker/detection.h"

namespace limn::tracker {

/// The gestures of one control in one camera's images.
struct GestureReading {
  /// How often the gesture was made since the detector's first image: turns forwards and all other gestures;
  /// turns backwards. They are counted, so that none is lost with one image's detections.
  int forward = 0, backward = 0;
  bool is_seen = false;                    ///< whether the image shows the marker
  std::optional<Stamp> hidden_since = {};  ///< as GestureReader::hidden_since

  bool operator==(const GestureReading&) const = default;
};

/// What one image of one camera shows: all that a session needs of it besides the image itself.
struct CameraDetections {
  std::string camera;
  Stamp captured_at;
  std::uint64_t run = 0;                      ///< another number: the gestures are counted anew
  std::vector<Detection> detections = {};     ///< markers with their corners' covariances, raw pixels
  std::vector<Ball> balls = {};               ///< likewise
  std::vector<GestureReading> controls = {};  ///< one for each control of the scene
};

/// As JSON, with all digits. What only the detector itself needs for the next image
/// (Detection::by_pattern, unshadowed) is left out.
nlohmann::ordered_json to_json(const CameraDetections& found);
/// Throws nlohmann::json::exception on a damaged one.
CameraDetections camera_detections_of(const nlohmann::ordered_json& json);

}  // namespace limn::tracker
