#pragma once

#include <Eigen/Core>
#include <limits>
#include <optional>
#include <vector>

#include "calib/measurement_model.h"
#include "calib/noise.h"
#include "calib/observations.h"
#include "core/result.h"
#include "core/rig.h"

namespace limn::calib {

struct SolveOptions;

/// All parameters of the bundle adjustment.
struct Parameters {
  std::vector<Imager> cameras, projectors;
  std::vector<std::optional<Pose>> world_from_board;  ///< none: no camera saw the board
  Eigen::Vector2d bend_m = Eigen::Vector2d::Zero();
  double twist_m = 0;
  Eigen::VectorXd print = {};  ///< empty: the board is as its text says
  /// Inverse depths of the tie points, along z of their camera's rays, 1/m; 0: the point is not used.
  std::vector<double> inverse_depths;
};

/// The least-squares problem over all observations and its minimisation by Levenberg-Marquardt (Nocedal and
/// Wright, Numerical Optimization, chapter 10). The robust loss is applied as weights that follow the
/// residuals (IRLS). No observation depends on two board poses or on two tie points, so these parameters are
/// eliminated block by block (Schur complement), and the factorised matrix has the size of the devices'
/// parameters alone. Observations are processed in a fixed order by one thread: the same input gives the same
/// bits.
class BundleAdjuster {
 public:
  /// `left_out`: the pose whose observations do not count; -1: none. Keeps references to both arguments.
  BundleAdjuster(const Observations& observations, const SolveOptions& options, int left_out = -1);

  struct Summary {
    Parameters parameters;
    int steps = 0;
    bool converged = false;  ///< converged; false: steps gained too little, or there were too many
    double cost = 0;
  };
  /// Minimises from `start`, until a step promises to lower the cost by less than the share `enough`. The
  /// cost is half the sum of squared normalised residuals. `enough`: 1e-9 minimises to rounding;
  /// k_to_significance stops where no parameter would move by more than a thirtieth of its own standard
  /// deviation. Errors: a start that is not finite, no step that lowers the cost, too many steps.
  Result<Summary> minimise(Parameters start, const Noise& noise, double enough);
  static constexpr double k_to_rounding = 1e-9, k_to_significance = 5e-4;

  /// Covariance of the devices' lens values and poses (the order of Solution::covariance) at a minimum,
  /// everything else marginalised. The effect of the robust weights is accounted for (Huber, Robust
  /// Statistics, section 7.6: by the mean of the loss's curvature and of its squared slope, estimated from
  /// the residuals).
  Eigen::MatrixXd covariance(Parameters at, const Noise& noise);

  /// Pose of one placement of the board from its corners alone, everything else fixed.
  Result<Pose> board_pose(const Parameters& at, int pose, const Noise& noise, const Pose& start) const;

 private:
  struct Group {  // observations of the same imagers and placement
    int camera = 0, projector = -1, pose = 0;
    std::vector<size_t> members;  // indices into corners (projector < 0) or matches
  };
  struct Eliminated {            // a board pose (6) or a tie point's inverse depth (1)
    Eigen::MatrixXd own, cross;  // cross: size of the block x number of the devices' parameters
    Eigen::VectorXd gradient;
  };
  struct NormalEquations {
    double cost = std::numeric_limits<double>::infinity();
    Eigen::MatrixXd devices;  // the devices' parameters, then the board's; lower half
    Eigen::VectorXd gradient;
    std::vector<Eliminated> boards, points;
    // Sums over coordinates of the weights, of the loss's curvatures and of its squared slopes.
    double weight = 0, curvature = 0, slope = 0, count = 0;
  };
  struct Step {
    Eigen::VectorXd devices;
    std::vector<Eigen::VectorXd> boards, points;
    double promised = 0;  // decrease of the cost that the linearised problem predicts
  };

  struct Problem;       // what minimise() works on: all of it,
  struct BoardProblem;  // or one placement of the board

  void group_observations();
  void index_parameters(const Parameters& of);
  NormalEquations evaluate(const Parameters& at, const Noise& noise);
  void add_group(const Group& group, const Parameters& at, const Noise& noise, NormalEquations* normal);
  void add_points(const Parameters& at, const Noise& noise, NormalEquations* normal);
  BoardShape shape(const Parameters& at) const;
  void add_print_priors(const Parameters& at, NormalEquations* normal) const;
  void add_priors(const Parameters& at, NormalEquations* normal) const;
  void add_lens_prior(const Imager& imager, bool is_projector, int at, NormalEquations* normal) const;
  double robust_weight(double squared, NormalEquations* normal) const;
  void place_points(Parameters* parameters) const;
  Eigen::MatrixXd reduced(const NormalEquations& normal, double damping, Eigen::VectorXd* gradient) const;
  std::optional<Step> step(const NormalEquations& normal, double damping) const;
  Parameters moved(const Parameters& from, const Step& step) const;

  const Observations& observations_;
  const SolveOptions& options_;
  int left_out_;
  std::vector<Group> groups_;
  std::vector<int> camera_at_, projector_at_;  // first index of a device's values among the parameters
  // First index and number of the board's parameters: bend, twist, print.
  int board_at_ = 0, board_count_ = 3;
  std::vector<bool> free_;                        // whether each of these parameters is free
  std::vector<LensRay> match_rays_, point_rays_;  // the last rays; the next search starts there
};

}  // namespace limn::calib
