#pragma once

#include <Eigen/Core>
#include <limits>
#include <optional>
#include <vector>

#include "calib/observations.h"
#include "calib/measurement_model.h"
#include "core/result.h"
#include "core/rig.h"

namespace limn::calib {

struct SolveOptions;

/// Everything that the joint solve asks for.
struct Parameters {
  std::vector<Imager> cameras, projectors;
  std::vector<std::optional<Pose>> world_from_board;  ///< none: no camera saw the board
  Eigen::Vector2d bend_m = Eigen::Vector2d::Zero();
  /// Of the tie points, along z of their camera's rays, 1/m; 0: the point is left out.
  std::vector<double> inverse_depths;
};

/// Standard deviation of one coordinate beyond each observation's own, px.
struct Noise {
  double corner_px = 0.2;
  double match_px = 0.2;
  double tie_point_px = 0.2;
};

/// The least-squares problem over all observations, and Levenberg's and Marquardt's way down (Nocedal and
/// Wright, Numerical Optimization, chapter 10), with the robust loss as weights that follow the residuals.
/// Board poses and the tie points' depths meet no observation of each other, so they are eliminated block by
/// block (Schur complement) and what is factorised has the size of the devices alone. Observations are taken
/// in a fixed order by one thread: the same input gives the same bits.
class BundleAdjuster {
 public:
  /// `left_out`: a pose whose observations do not count; -1: none. Borrows both references.
  BundleAdjuster(const Observations& observations, const SolveOptions& options, int left_out = -1);

  struct Summary {
    Parameters parameters;
    int steps = 0;
    bool converged = false;  ///< nothing left to gain; otherwise stopped in a valley or by the number of steps
    double cost = 0;
  };
  /// From `start` to the nearest minimum: until a step promises less than `enough` of the cost, which counts
  /// half squares of standard deviations (1e-9: to rounding; k_to_significance: where nothing moves by more than a
  /// thirtieth of its own uncertainty). Errors: no finite start, no step downwards, too many steps.
  Result<Summary> minimise(Parameters start, const Noise& noise, double enough);
  static constexpr double k_to_rounding = 1e-9, k_to_significance = 5e-4;

  /// Of the devices' values and poses (the order of Solution::covariance) at a minimum, everything else
  /// marginalised; what the robust weights do to it is accounted for (Huber, Robust Statistics, section 7.6:
  /// the mean of the loss's curvature and of its squared slope, from the residuals themselves).
  Eigen::MatrixXd covariance(const Parameters& at, const Noise& noise);

  /// Of one placement of the board from its corners alone, everything else fixed.
  Result<Pose> board_pose(const Parameters& at, int pose, const Noise& noise, Pose start) const;

 private:
  struct Group {  // observations of the same imagers and placement
    int camera = 0, projector = -1, pose = 0;
    std::vector<size_t> members;  // into corners (projector < 0) or matches
  };
  struct Eliminated {            // a board pose (6) or a tie point's inverse depth (1)
    Eigen::MatrixXd own, cross;  // cross: its size x the devices'
    Eigen::VectorXd gradient;
  };
  struct NormalEquations {
    double cost = std::numeric_limits<double>::infinity();
    Eigen::MatrixXd devices;  // and the bend, last; lower half
    Eigen::VectorXd gradient;
    std::vector<Eliminated> boards, points;
    // Sums over coordinates: weights, curvatures of the loss, its squared slopes.
    double weight = 0, curvature = 0, slope = 0, count = 0;
  };
  struct Step {
    Eigen::VectorXd devices;
    std::vector<Eigen::VectorXd> boards, points;
    double promised = 0;  // how far the cost falls if the problem is what its normal equations say
  };

  void index_parameters();
  NormalEquations evaluate(const Parameters& at, const Noise& noise);
  void add_group(const Group& group, const Parameters& at, const Noise& noise, NormalEquations* normal);
  void add_points(const Parameters& at, const Noise& noise, NormalEquations* normal);
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
  BoardShape shape_;
  std::vector<Group> groups_;
  std::vector<int> camera_at_, projector_at_;  // first index of a device's values among the unknowns
  int bend_at_ = 0;
  std::vector<bool> free_;                        // of the devices' unknowns and the bend
  std::vector<LensRay> match_rays_, point_rays_;  // where they were last: the next search starts there
};

}  // namespace limn::calib
