#include "calib/judge/moved_device_fit.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>

#include "calib/board_print.h"
#include "core/least_squares.h"

namespace limn::calib {
namespace {

using Eigen::Vector2d;

constexpr HuberLoss k_loss{3};  // in rig_px; against wrong pixels and reflections
// A weak prior: as far as a device may have moved.
constexpr double k_loose_rad = 5 * std::numbers::pi / 180, k_loose_m = 0.2;
// Without a board, a device is undetermined when its position along the light's direction has a larger
// standard deviation: two devices alone do not give the scale.
constexpr double k_undetermined_m = 0.02;

// Least squares over a handful of poses.
class Fit {
 public:
  Fit(const Observations& observations, const RigCheckOptions& options, const MoveHypothesis& free)
      : observations_(observations),
        options_(options),
        free_(free),
        shape_{observations.board.width_m(), observations.board.height_m(), options.twist_m} {
    int at = free_.device == MoveHypothesis::k_nobody ? 0 : 6;
    for (const bool is_free : free_.boards) {
      board_at_.push_back(is_free ? at : -1);
      at += is_free ? 6 : 0;
    }
    bend_at_ = at;
    unknowns_ = at + 2;
    for (const CornerObservation& seen : observations.corners) ++counts_[{seen.camera, -1, seen.pose}];
    for (const Match& match : observations.matches) ++counts_[{match.camera, match.projector, match.pose}];
    for (const TiePointObservation& tie_observation : observations.tie_observations)
      ++counts_[coarse_sample_of(tie_observation)];
  }

  MovedDeviceFit run(RigCheckPlaces places) const {
    NormalEquations normal = linearised(&places);
    Problem problem{.fit = *this, .places = std::move(places), .normal = std::move(normal)};
    minimise(&problem, {.max_steps = 60, .least_damping = 1e-9});
    MovedDeviceFit fitted{std::move(problem.places)};
    fitted.misfit = problem.normal.cost;
    judge(problem.normal, &fitted);
    return fitted;
  }

 private:
  struct NormalEquations {
    Eigen::MatrixXd matrix;
    Eigen::VectorXd right;
    double cost = 0;  ///< robust sum of squares of the independent samples, rig_px^2
    int count = 0;    ///< observations with a prediction
  };

  // For minimise(): the equations come with the cost. No step is found once the caller has had enough.
  struct Problem {
    const Fit& fit;
    RigCheckPlaces places;
    NormalEquations normal;
    RigCheckPlaces moved{};
    NormalEquations next{};
    Eigen::VectorXd step{};

    double cost() const { return normal.cost; }
    bool solve(double damping) {
      if (fit.options_.should_continue && !fit.options_.should_continue()) return false;
      step = -damped(normal.matrix, damping).ldlt().solve(normal.right);
      return step.allFinite();
    }
    double evaluate_trial() {
      moved = fit.stepped(places, step);
      next = fit.linearised(&moved);
      return next.count == normal.count ? next.cost : std::numeric_limits<double>::infinity();
    }
    void accept_trial() {
      places = std::move(moved);
      normal = std::move(next);
    }
    bool is_settled(const LeastSquaresTrial& tried) const {
      return tried.is_accepted && tried.gain() < 1e-9 * tried.cost_before;
    }
  };

  // A residual with its derivatives by the parameters.
  struct Row {
    Vector2d residual;
    Eigen::Matrix<double, 2, Eigen::Dynamic> by;
  };
  static void add(const Row& row, double stddev, double share, NormalEquations* normal) {
    const double size = row.residual.norm() / stddev;
    const double weight = share * k_loss.weight(size * size) / (stddev * stddev);
    normal->matrix.noalias() += weight * row.by.transpose() * row.by;
    normal->right.noalias() += weight * row.by.transpose() * row.residual;
    normal->cost += share * k_loss.cost(size * size);
    ++normal->count;
  }

  // Identifies a sample group. For a board: camera, projector (-1: the camera's corners), pose. For a scene:
  // camera, device that observes its points (-2 and below: cameras), pose.
  using CoarseSample = std::array<int, 3>;
  CoarseSample coarse_sample_of(const TiePointObservation& tie_observation) const {
    const TiePoint& point = observations_.points[static_cast<size_t>(tie_observation.point)];
    return {point.camera, tie_observation.by_projector ? tie_observation.imager : -2 - tie_observation.imager,
            point.pose};
  }
  // The share of one observation of a sample group that is independent of the others.
  double share_of(const CoarseSample& coarse_sample) const {
    return std::min(1.0, static_cast<double>(options_.independent) / counts_.at(coarse_sample));
  }

  Row empty_row() const { return {Vector2d::Zero(), Eigen::Matrix2Xd::Zero(2, unknowns_)}; }

  void put(const Derivatives::Pose6& by_pose, int at, Row* row) const {
    if (at >= 0) row->by.middleCols<6>(at) = by_pose;
  }
  int device_at(size_t device) const { return device == free_.device ? 0 : -1; }

  // Observations of a tie point by other devices, at an inverse depth: residual rows with their weights.
  struct PointRow {
    Row row;
    Vector2d by_inverse_depth;
    double weight = 0, cost = 0;
  };
  std::vector<PointRow> rows_of(size_t index,
                                std::span<const TiePointObservation> tie_observations,
                                const RigCheckPlaces& places,
                                double inverse_depth) const {
    std::vector<PointRow> rows;
    const TiePoint& point = observations_.points[index];
    const auto camera = static_cast<size_t>(point.camera);
    LensRay ray;
    const Imager& from = places.devices[camera];
    if (!find_ray(from.lens.model, from.lens.values, point.px_camera, true, &ray)) return rows;
    for (const TiePointObservation& tie_observation : tie_observations) {
      const size_t device = places.device_of(tie_observation);
      Vector2d px;
      TiePointDerivatives by;
      if (!predict_tie_point(view_of(from), view_of(places.devices[device]), ray, inverse_depth, &px, &by))
        continue;
      PointRow seen{empty_row(), by.inverse_depth};
      seen.row.residual = px - tie_observation.px;
      put(by.camera_pose, device_at(camera), &seen.row);
      put(by.pose, device_at(device), &seen.row);
      const double stddev = std::hypot(tie_observation.stddev_px, options_.rig_px);
      const double size = seen.row.residual.norm() / stddev,
                   share = share_of(coarse_sample_of(tie_observation));
      seen.weight = share * k_loss.weight(size * size) / (stddev * stddev);
      seen.cost = share * k_loss.cost(size * size);
      rows.push_back(std::move(seen));
    }
    return rows;
  }

  // Tie points are eliminated: whatever the devices' poses, each lies where its observations fit best
  // (variable projection, Golub and Pereyra 1973).
  void add_points(RigCheckPlaces* places, NormalEquations* normal) const {
    constexpr int k_rounds = 3;
    each_point(observations_, [&](size_t index, std::span<const TiePointObservation> tie_observations) {
      double& inverse_depth = places->inverse_depths[index];
      if (inverse_depth == 0) return;
      std::vector<PointRow> rows;
      double information = 0;
      for (int round = 0; round < k_rounds; ++round) {
        rows = rows_of(index, tie_observations, *places, inverse_depth);
        double right = 0;
        information = 0;
        for (const PointRow& seen : rows) {
          information += seen.weight * seen.by_inverse_depth.squaredNorm();
          right += seen.weight * seen.by_inverse_depth.dot(seen.row.residual);
        }
        if (!(information > 0) || round + 1 == k_rounds) break;
        inverse_depth = std::max(1e-6, inverse_depth - right / information);
      }
      if (!(information > 0)) return;
      Eigen::RowVectorXd with_depth = Eigen::RowVectorXd::Zero(unknowns_);
      double right = 0;
      for (const PointRow& seen : rows) {
        normal->matrix.noalias() += seen.weight * seen.row.by.transpose() * seen.row.by;
        normal->right.noalias() += seen.weight * seen.row.by.transpose() * seen.row.residual;
        with_depth += seen.weight * seen.by_inverse_depth.transpose() * seen.row.by;
        right += seen.weight * seen.by_inverse_depth.dot(seen.row.residual);
        normal->cost += seen.cost;
        ++normal->count;
      }
      normal->matrix.noalias() -= with_depth.transpose() * with_depth / information;
      normal->right -= with_depth.transpose() * right / information;
    });
  }

  NormalEquations linearised(RigCheckPlaces* given) const {
    NormalEquations normal{Eigen::MatrixXd::Zero(unknowns_, unknowns_), Eigen::VectorXd::Zero(unknowns_)};
    add_points(given, &normal);
    const RigCheckPlaces& places = *given;
    Derivatives by;
    for (const CornerObservation& seen : observations_.corners) {
      const auto& board = places.world_from_board[static_cast<size_t>(seen.pose)];
      if (!board) continue;
      Row row = empty_row();
      Vector2d px;
      if (!predict_corner(view_of(places.camera(seen.camera)), *board, shape_, places.bend,
                          printed_corner(observations_.board, options_.print, seen.corner), &px, &by))
        continue;
      row.residual = px - seen.px;
      put(by.camera_pose, device_at(static_cast<size_t>(seen.camera)), &row);
      put(by.board_pose, board_at_[static_cast<size_t>(seen.pose)], &row);
      row.by.middleCols<2>(bend_at_) = by.bend;
      add(row, std::hypot(seen.stddev_px, options_.rig_px), share_of({seen.camera, -1, seen.pose}), &normal);
    }
    for (const Match& match : observations_.matches) {
      const auto& board = places.world_from_board[static_cast<size_t>(match.pose)];
      if (!board) continue;
      Row row = empty_row();
      Vector2d px;
      if (!predict_match(view_of(places.camera(match.camera)), view_of(places.projector(match.projector)),
                         *board, shape_, places.bend, match.px_camera, &px, &by))
        continue;
      row.residual = px - match.px_projector;
      put(by.camera_pose, device_at(static_cast<size_t>(match.camera)), &row);
      put(by.projector_pose, device_at(places.cameras + static_cast<size_t>(match.projector)), &row);
      put(by.board_pose, board_at_[static_cast<size_t>(match.pose)], &row);
      row.by.middleCols<2>(bend_at_) = by.bend;
      add(row, std::hypot(match.stddev_px, options_.rig_px),
          share_of({match.camera, match.projector, match.pose}), &normal);
    }
    const double weight = 1 / (options_.bend_stddev_m * options_.bend_stddev_m);
    const Vector2d off = places.bend - options_.bend_m;
    if (free_.device != MoveHypothesis::k_nobody) {
      normal.matrix.diagonal().head<3>().array() += 1 / (k_loose_rad * k_loose_rad);
      normal.matrix.diagonal().segment<3>(3).array() += 1 / (k_loose_m * k_loose_m);
    }
    normal.matrix.bottomRightCorner<2, 2>().diagonal().array() += weight;
    normal.right.tail<2>() += weight * off;
    normal.cost += weight * off.squaredNorm();
    return normal;
  }

  RigCheckPlaces stepped(RigCheckPlaces places, const Eigen::VectorXd& step) const {
    if (free_.device != MoveHypothesis::k_nobody) {
      Pose& pose = places.devices[free_.device].imager_from_world;
      pose = boxplus(pose, step.head<6>());
    }
    for (size_t i = 0; i < board_at_.size(); ++i) {
      if (board_at_[i] >= 0)
        places.world_from_board[i] = boxplus(*places.world_from_board[i], step.segment<6>(board_at_[i]));
    }
    places.bend += step.tail<2>();
    return places;
  }

  // Computes the free device's covariance, and whether the pose is determined at all.
  void judge(const NormalEquations& normal, MovedDeviceFit* fitted) const {
    const Eigen::VectorXd scale =
        normal.matrix.diagonal().cwiseMax(std::numeric_limits<double>::min()).cwiseSqrt().cwiseInverse();
    const Eigen::LDLT<Eigen::MatrixXd> scaled(
        Eigen::MatrixXd(scale.asDiagonal() * normal.matrix * scale.asDiagonal()));
    constexpr double k_undetermined = 1e-10;  // relative to a unit diagonal
    fitted->determined = scaled.vectorD().minCoeff() > k_undetermined;
    if (!fitted->determined || free_.device == MoveHypothesis::k_nobody) return;
    const Eigen::MatrixXd inverse = scale.asDiagonal() *
                                    scaled.solve(Eigen::MatrixXd::Identity(unknowns_, unknowns_)) *
                                    scale.asDiagonal();
    fitted->covariance = inverse.topLeftCorner<6, 6>();
    const double stddev_m = std::sqrt(fitted->covariance.bottomRightCorner<3, 3>().diagonal().maxCoeff());
    fitted->determined = stddev_m < k_undetermined_m;
  }

  const Observations& observations_;
  const RigCheckOptions& options_;
  MoveHypothesis free_;
  BoardShape shape_;
  std::vector<int> board_at_;  // first column of each board's pose; -1: fixed
  int bend_at_ = 0, unknowns_ = 0;
  std::map<CoarseSample, int> counts_;  // number of observations in each group
};

}  // namespace

MovedDeviceFit fit_moved_device(const Observations& observations,
                                const RigCheckOptions& options,
                                const MoveHypothesis& free,
                                const RigCheckPlaces& places) {
  return Fit(observations, options, free).run(places);
}

}  // namespace limn::calib
