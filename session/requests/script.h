#pragma once

#include <filesystem>
#include <functional>
#include <opencv2/core/types.hpp>
#include <string>
#include <vector>

#include "core/frame.h"
#include "core/pose.h"
#include "core/result.h"
#include "scene/actions.h"
#include "sim/virtual_rig.h"

namespace limn::session {

/// The scripted events of a virtual session (limn.script/1; config/README.md explains the keys). Times are
/// seconds of the session's clock.
struct Script {
  /// A marker's object swings to and fro along a direction of its own frame; at until_s it stays where it is.
  struct Sway {
    std::string marker;
    double from_s = 0, until_s = 0;
    Eigen::Vector3d amplitude_m = Eigen::Vector3d::Zero();
    double hz = 0.5;
  };
  /// From at_s on the marker stands elsewhere, at this pose in the frame of its original place. It jumps
  /// there.
  struct Move {
    std::string marker;
    double at_s = 0;
    Pose home_from_marker;
  };
  /// A hand rests on a marker.
  struct Cover {
    std::string marker;
    double from_s = 0, until_s = 0;
  };
  /// A hand is held into a projector's light.
  struct Block {
    std::string projector;
    double from_s = 0, until_s = 0;
  };
  struct Unplug {
    std::string device;
    double from_s = 0, until_s = 0;
  };
  /// A camera sends images of another size.
  struct Resize {
    std::string camera;
    double from_s = 0, until_s = 0;
    cv::Size size;
  };
  /// From at_s on a camera's stamps are later by step_s; a negative step makes them earlier.
  struct ClockStep {
    std::string camera;
    double at_s = 0;
    double step_s = 0;
  };
  /// A camera or projector is knocked out of its calibrated pose, and later put back.
  struct Nudge {
    std::string device;
    double from_s = 0, until_s = 0;
    Pose home_from_device;
  };
  struct Action {
    double at_s = 0;
    scene::Edit edit;
  };

  double seconds = 0;
  std::vector<Sway> sways;
  std::vector<Move> moves;
  std::vector<Cover> covers;
  std::vector<Block> blocks;
  std::vector<Unplug> unplugs;
  std::vector<Nudge> nudges;
  std::vector<Resize> resizes;
  std::vector<ClockStep> clock_steps;
  std::vector<Action> edits;  ///< in the order of their times

  bool is_plugged(const std::string& device, double at_s) const;
};

Result<Script> load_script(const std::filesystem::path& path);

/// Plays a script in a virtual rig: puts everything where it stands at a moment.
class ScriptedRoom {
 public:
  /// Error: the script names a marker or device that is not in the room.
  static Result<ScriptedRoom> create(Script script, sim::VirtualRig* rig);

  const Script& script() const { return script_; }
  /// Sets the room to its state at a moment.
  void set(double at_s);
  /// The frame that the camera sends for one that was exposed at a moment: resizing and clock steps are
  /// applied.
  Frame sent(Frame exposed, double at_s) const;
  /// The scripted pose of a placed marker at a moment, in the world frame.
  Pose world_from_marker(const MarkerName& marker, double at_s) const;

 private:
  struct Home {
    sim::PlacedMarker placed;
    Pose world_from_object;
  };
  const Home& home_of(const std::string& marker) const;
  void nudge(double at_s);
  Pose place_of(const Home& home, double at_s) const;
  void put(const std::string& name, bool is_due, const std::function<sim::Object()>& hand);

  Script script_;
  sim::VirtualRig* rig_ = nullptr;
  std::vector<Home> homes_;
  std::vector<std::pair<std::string, Pose>> devices_;  // imager_from_world without a nudge
};

}  // namespace limn::session
