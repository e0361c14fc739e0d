#pragma once

#include <memory>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "calib/observations.h"
#include "core/rig.h"
#include "scene/meshes/mesh.h"

namespace limn::test {

/// A camera and a projector with known truth in camera 0's world, and board poses that fill their common
/// space. Calibrations are judged with it.
struct TrueRig {
  Rig rig;
  calib::Board board;
  std::vector<Pose> world_from_board;
  Eigen::Vector2d bow_m = Eigen::Vector2d::Zero();  ///< bend of the board, as in calib::BoardShape
  double twist_m = 0;
  Pose world_from_prototype;  ///< centre of the space, facing camera and projector
};

struct RigOptions {
  double k1 = 0;     ///< radial distortion of the projector's lens
  double shift = 0;  ///< shift of the projector's lens, panel heights
  double bow_m = 0;  ///< bend of the board along its width
  int poses = 12;
  double tilt = 0.55;          ///< largest tilt of the board, rad
  double spread = 1;           ///< spread of the boards over the space; 0: all in the middle
  double asunder = 0.5;        ///< m from camera to projector
  bool square_pixels = false;  ///< those of the camera; otherwise they are 0.13 % higher than wide
  bool quarter_turns = false;  ///< every third board is held on its side, every third turned by 180 degrees
  unsigned seed = 1;           ///< seed of the poses
};
/// Camera 1280 x 960, projector 800 x 600 with pixels of about 1 mm at the board, 1.3 m away.
TrueRig make_true_rig(const RigOptions& options);

/// The observations of the rig, without images: corners and matches with normal noise (px, one coordinate).
/// `each`: one of this many cells is used.
calib::Observations observed_perfectly(const TrueRig& rig, int each = 1);
void add_noise(double corner_px, double match_px, std::mt19937_64* rng, calib::Observations* observations);
/// Errors that the matches of one placement of the board share, as decoding leaves them: a shift and a slope
/// over the board, of this standard deviation at its edges (px, one coordinate).
void add_shared_errors(double px, std::mt19937_64* rng, calib::Observations* observations);

/// Prototypes, metres, facing -z of their frame: a curved panel, boxes and balls in front of a plate, a
/// trough.
enum class Prototype { panel, cluster, concave };
std::string to_text(Prototype prototype);
scene::Mesh prototype_mesh(Prototype prototype);

/// How far (mm) light lands from the surface points it is meant for. The prototype's pose is measured by the
/// calibrated camera 0 from 24 of its points with `pnp_px` of noise, and the calibrated projector's pixel of
/// each point is traced with the true projector.
struct Landed {
  std::vector<double> in_place_mm, moved_mm, turned_mm;  ///< moved by 150 mm, turned by 40 degrees
  std::vector<double> pooled_mm() const;
};
Landed landed(const TrueRig& truth,
              const Rig& calibrated,
              const scene::Mesh& prototype,
              double pnp_px,
              int points,
              std::mt19937_64* rng);

double rms(const std::vector<double>& values);
double p95(std::vector<double> values);
/// Share of the values that are at most `limit`.
double share_within(const std::vector<double>& values, double limit);

}  // namespace limn::test
