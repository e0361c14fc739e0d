#pragma once

#include <Eigen/Core>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "calib/observations.h"
#include "core/pose.h"
#include "core/result.h"
#include "core/rig.h"

namespace limn::calib {

struct RigCheckOptions {
  /// How far off a sound rig predicts pixels, RMS of one coordinate: its held-out error over sqrt 2.
  double rig_px = 0.2;
  /// That error is smooth over the image: one sight of a board (a camera's corners, a projector's light in
  /// a camera) holds about so many independent samples of it, however many observations there are. All
  /// significance and all standard deviations follow from these two numbers.
  int independent = 12;
  /// Smaller moves than both are no nudge: 0.05 degrees are 1.2 mm at 1.4 m.
  double min_deg = 0.05;
  double min_mm = 0.5;
  /// How the board is known to be bent (Solution::bend_m), and how well: other boards than the calibration's
  /// are known to be flat to this.
  Eigen::Vector2d bend_m = Eigen::Vector2d::Zero();
  double bend_stddev_m = 0.0005;
  /// For each pose: where its board stood when the rig was sound, if nobody has touched it since. One of them
  /// tells a moved camera from a moved projector where there is only one of each.
  std::vector<std::optional<Pose>> still_boards = {};
  /// Asked at every step of the fits; false ends it with an error.
  std::function<bool()> should_continue = nullptr;
};

/// How far a device has moved. Standard deviations hold the rig's own error.
struct Move {
  std::string device;
  bool is_projector = false;
  double degrees = 0, degrees_stddev = 0;  ///< its turn
  double mm = 0, mm_stddev = 0;            ///< of its centre
  double px = 0;                           ///< what that does to its pixels of things on the board, RMS
  double mm_on_board = 0;                  ///< the same on the board, or on the scene
  Pose imager_from_world;                  ///< where it stands now
};

enum class RigVerdict {
  sound,       ///< nobody has moved
  moved,      ///< one device has
  undecided,   ///< one of the candidates has, relative to the others; these observations cannot tell which
  unexplained  ///< no move of one device explains what is seen
};
std::string to_text(RigVerdict verdict);

struct CheckedDevice {
  std::string name;
  int observations = 0;  ///< corners, matches and tie-point observations that tell of it; 0: it was not checked
  double before_px = 0;  ///< RMS misfit of the rig as it was
  double after_px = 0;   ///< and with the first candidate moved
};

struct RigCheck {
  RigVerdict verdict = RigVerdict::sound;
  std::vector<CheckedDevice> devices;  ///< of the rig, cameras first
  std::vector<Move> candidates;        ///< empty unless nudged or undecided; the one in `rig` first
  bool board_moved = false;            ///< a board of still_boards has been touched (then it is not used)
  std::vector<std::optional<Pose>> world_from_board;  ///< for each pose
  /// As given, with the first candidate's pose re-solved and its lens kept.
  Rig rig;
};

/// Has a camera or a projector of a calibrated rig moved? For "nobody" and for every single device the poses
/// of the boards (and of that device) are fitted to what is seen, lenses kept. Without a board a scene will
/// do, by its tie points, where three devices share it: two of them that have not moved tell its distance.
/// A device has moved when its fit is clearly better than nobody's and puts its pixels clearly elsewhere;
/// others that fit as well are candidates too. Errors: devices that the rig does not have or has in another
/// size, neither a board nor such a scene in view.
Result<RigCheck> check_rig(const Rig& rig, const Observations& observations, const RigCheckOptions& options = {});

}  // namespace limn::calib
