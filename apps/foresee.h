#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "calib/board/board.h"
#include "core/result.h"
#include "core/rig.h"

namespace limn::apps {

/// A rig that is thought of, not bought: a limn.described/1 file (config/README.md).
struct Described {
  Rig rig;  ///< lenses without distortion; world: metres, z up
  Eigen::Vector3d p_centre = Eigen::Vector3d::Zero(), size_m = Eigen::Vector3d::Zero();  ///< working volume
  Eigen::Vector3d d_front = -Eigen::Vector3d::UnitY();  ///< where the prototype's lit side looks
  double room_lux = 0;                                  ///< other light on that side; 0: not known
  std::vector<double> lumens;                           ///< of each projector; 0: not known
  calib::Board board;
  int poses = 12;  ///< placements of the board
  double corner_px =
      0.08;  ///< noise of a board corner in a camera's picture, standard deviation of a coordinate
  double match_px = 0.05;  ///< of a decoded place on a projector's panel
  double marker_m = 0.04;  ///< side of a designer's marker
  double marker_px = 0.1;  ///< noise of its corners
};

/// Errors name the file and the key.
Result<Described> load_described(const std::filesystem::path& path);

/// An imager and the prototype's lit side in the middle of the volume.
struct ForeseenImager {
  std::string name;
  double distance_m = 0;
  double pixel_mm = 0;    ///< of a surface that faces it
  double surface_mm = 0;  ///< of the lit side, along its steeper direction; infinite when it looks away
  double steep_deg = 0;   ///< between its ray and the lit side's normal
  double coverage = 0;    ///< share of the volume that it reaches
  double lux = 0;         ///< a projector's white on the lit side; 0: not known
};

/// A camera and a projector together.
struct ForeseenPair {
  std::string camera, projector;
  double angle_deg = 0;  ///< between their rays in the middle of the volume
  double coverage = 0;   ///< share of the volume that both reach
};

/// A camera and a designer's marker on the lit side, in the middle of the volume: 95 % errors of its place.
struct ForeseenMarker {
  std::string camera;
  double side_px = 0;      ///< across its steeper direction
  double farthest_px = 0;  ///< likewise, at the farthest corner of the volume
  double across_mm = 0;    ///< across the camera's view: what stays where a known surface carries it
  double along_mm = 0;     ///< along the view
};

struct Foreseen {
  std::vector<ForeseenImager> cameras, projectors;
  std::vector<ForeseenPair> pairs;
  std::vector<ForeseenMarker> markers;  ///< of the cameras that see one
  /// For each projector: 95 % error of its light on the surface as a calibration would state it
  /// (report.json's predicted_error_mm); infinite where nothing is known. Of that, the calibration's part,
  /// and that of measuring where the prototype stands.
  std::vector<double> error_mm, calibration_mm, measuring_mm;
  double coverage = 0;              ///< share of the volume that camera 0 and a projector at least reach
  std::vector<std::string> advice;  ///< what limits, most hurtful first; empty: nothing
};

/// Plays the calibration: board placements all over the volume, what cameras and projectors would observe of
/// them with normal noise, `calib::solve` and `calib::assess` on that. Room light, defocus, a bending board
/// and a lens that its model does not hold are not in it. The same file gives the same numbers. Errors: no
/// solve, with what the solve says.
Result<Foreseen> foresee(const Described& described);

/// What `limn plan` prints.
std::string foreseen_table(const Foreseen& foreseen, const Described& described);

struct ForeseeOptions {
  std::filesystem::path described;
  std::filesystem::path out;  ///< folder for plan.html and plan.json; empty: none
  bool json = false;          ///< JSON on stdout instead of a table
};
Status run_foresee(const ForeseeOptions& options);

}  // namespace limn::apps
