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
  /// RMS prediction error of a sound rig for one pixel coordinate: its held-out error over sqrt 2.
  double rig_px = 0.2;
  /// That error is smooth over the image, so a board in one image (a camera's corners, a projector's light in
  /// a camera) counts as about this many independent samples, however many observations there are. All
  /// significances and all standard deviations follow from these two numbers.
  int independent = 12;
  /// A move smaller than both limits is ignored: 0.05 degrees are 1.2 mm at 1.4 m.
  double min_deg = 0.05;
  double min_mm = 0.5;
  /// The board's known bend (Solution::bend_m), and its standard deviation. Boards other than the
  /// calibration's are assumed flat to this.
  Eigen::Vector2d bend_m = Eigen::Vector2d::Zero();
  double bend_stddev_m = 0.0005;
  /// The board's known twist and print (Solution::twist_m, Solution::print); an empty print is exact.
  double twist_m = 0;
  Eigen::VectorXd print = {};
  /// For each pose: where its board stood when the rig was sound, if nobody has touched it since. Such a
  /// board distinguishes a moved camera from a moved projector where there is only one of each.
  std::vector<std::optional<Pose>> still_boards = {};
  /// Called at every step of the fits; when it returns false, the check ends with an error.
  std::function<bool()> should_continue = nullptr;
};

/// How far a device has moved. Standard deviations include the rig's own error.
struct Move {
  std::string device;
  bool is_projector = false;
  double degrees = 0, degrees_stddev = 0;  ///< rotation
  double mm = 0, mm_stddev = 0;            ///< movement of its centre
  double px = 0;                           ///< effect on its pixels of points on the board, RMS
  double mm_on_board = 0;                  ///< the same as a distance on the board, or on the scene
  Pose imager_from_world;                  ///< its pose now
};

enum class RigVerdict {
  sound,       ///< no device has moved
  moved,       ///< one device has moved
  undecided,   ///< one of the candidates has moved; these observations cannot tell which
  unexplained  ///< no move of a single device explains the observations
};
std::string to_text(RigVerdict verdict);

struct CheckedDevice {
  std::string name;
  int observations = 0;  ///< corners, matches and tie-point observations of the device; 0: it was not checked
  double before_px = 0;  ///< RMS misfit of the rig as it was
  double after_px = 0;   ///< RMS misfit with the first candidate moved
};

struct RigCheck {
  RigVerdict verdict = RigVerdict::sound;
  std::vector<CheckedDevice> devices;  ///< devices of the rig, cameras first
  std::vector<Move> candidates;  ///< empty unless the verdict is nudged or undecided; the one in `rig` first
  bool board_moved = false;      ///< a board of still_boards has been touched (and is not used)
  std::vector<std::optional<Pose>> world_from_board;  ///< for each pose
  /// The given rig with the first candidate's pose re-solved; lenses are kept.
  Rig rig;
};

/// Detects whether a camera or a projector of a calibrated rig has moved. For the hypothesis "none" and for
/// every single device, the poses of the boards (and of that device) are fitted to the observations; lenses
/// are kept. Without a board a scene is enough, by its tie points, where three devices share it: two of them
/// that have not moved give its depth. A device has moved when its fit is clearly better than that of "none"
/// and shifts its pixels clearly; other devices that fit as well are candidates too. Errors: devices that the
/// rig does not have or has in another size; neither a board nor such a scene in view.
Result<RigCheck> check_rig(const Rig& rig,
                           const Observations& observations,
                           const RigCheckOptions& options = {});

}  // namespace limn::calib
