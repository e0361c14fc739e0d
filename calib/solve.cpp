#include "calib/solve.h"

#include <ceres/ceres.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

#include "calib/seed.h"

namespace limn::calib {
namespace {

using Eigen::Vector2d;

constexpr double k_outlier_at = 4;  // standard deviations: one in 3000 of sound observations

// A pose as Ceres holds it: quaternion x y z w, then translation.
struct PoseBlock {
  double v[7];
  explicit PoseBlock(const Pose& pose = {}) {
    Eigen::Map<Eigen::Vector4d>{v} = pose.rotation.coeffs();
    Eigen::Map<Eigen::Vector3d>{v + 4} = pose.translation;
  }
  Pose pose() const { return read(v); }
  static Pose read(const double* v) {
    return {Eigen::Quaterniond(v[3], v[0], v[1], v[2]), Eigen::Vector3d(v[4], v[5], v[6])};
  }
};

using Matrix76 = Eigen::Matrix<double, 7, 6, Eigen::RowMajor>;
using Matrix67 = Eigen::Matrix<double, 6, 7, Eigen::RowMajor>;

// d(quaternion, translation) / d(boxplus's delta).
Matrix76 by_delta(const double* v) {
  const Eigen::Vector3d q(v[0], v[1], v[2]);
  Matrix76 m = Matrix76::Zero();
  Eigen::Matrix3d cross;
  cross << 0, -q.z(), q.y(), q.z(), 0, -q.x(), -q.y(), q.x(), 0;
  m.topLeftCorner<3, 3>() = 0.5 * (v[3] * Eigen::Matrix3d::Identity() - cross);
  m.block<1, 3>(3, 0) = -0.5 * q.transpose();
  m.bottomRightCorner<3, 3>().setIdentity();
  return m;
}

// Its left inverse: what cost functions multiply by, because Ceres multiplies by by_delta() after them.
Matrix67 by_block(const double* v) {
  Matrix67 m = by_delta(v).transpose();
  m.topLeftCorner<3, 4>() *= 4;
  return m;
}

class PoseManifold final : public ceres::Manifold {
 public:
  int AmbientSize() const override { return 7; }
  int TangentSize() const override { return 6; }
  bool Plus(const double* x, const double* delta, double* x_plus_delta) const override {
    const PoseBlock moved(boxplus(PoseBlock::read(x), Eigen::Map<const Vector6d>(delta)));
    std::copy_n(moved.v, 7, x_plus_delta);
    return true;
  }
  bool PlusJacobian(const double* x, double* jacobian) const override {
    Eigen::Map<Matrix76>{jacobian} = by_delta(x);
    return true;
  }
  bool Minus(const double* y, const double* x, double* y_minus_x) const override {
    Eigen::Map<Vector6d>{y_minus_x} = boxminus(PoseBlock::read(y), PoseBlock::read(x));
    return true;
  }
  bool MinusJacobian(const double* x, double* jacobian) const override {
    Eigen::Map<Matrix67>{jacobian} = by_block(x);
    return true;
  }
};

// Writes a derivative by a pose where Ceres wants it.
void put_pose(const Derivatives::Pose6& derivative, const double* block, double weight, double* out) {
  if (out)
    Eigen::Map<Eigen::Matrix<double, 2, 7, Eigen::RowMajor>>{out} = weight * derivative * by_block(block);
}
void put_values(const Derivatives::Values& derivative, double weight, double* out) {
  if (out) Eigen::Map<Derivatives::Values>(out, 2, derivative.cols()) = weight * derivative;
}
void put_bend(const Eigen::Matrix2d& derivative, double weight, double* out) {
  if (out) Eigen::Map<Eigen::Matrix<double, 2, 2, Eigen::RowMajor>>{out} = weight * derivative;
}

// Parameter blocks: camera values, camera pose, board pose, bend.
class CornerCost final : public ceres::CostFunction {
 public:
  CornerCost(const LensModel& model, const BoardShape& shape, Vector2d p_board, Vector2d px, double weight)
      : model_(model), shape_(shape), p_board_(std::move(p_board)), px_(std::move(px)), weight_(weight) {
    set_num_residuals(2);
    *mutable_parameter_block_sizes() = {model.value_count(), 7, 7, 2};
  }
  bool Evaluate(double const* const* blocks, double* residuals, double** jacobians) const override {
    const Pose camera_from_world = PoseBlock::read(blocks[1]);
    const ImagerView camera{
        model_, {blocks[0], static_cast<size_t>(model_.value_count())}, camera_from_world};
    Derivatives derivatives;
    Vector2d px;
    if (!predict_corner(camera, PoseBlock::read(blocks[2]), shape_, Vector2d(blocks[3][0], blocks[3][1]),
                        p_board_, &px, jacobians ? &derivatives : nullptr))
      return false;
    Eigen::Map<Vector2d>{residuals} = weight_ * (px - px_);
    if (!jacobians) return true;
    put_values(derivatives.camera_values, weight_, jacobians[0]);
    put_pose(derivatives.camera_pose, blocks[1], weight_, jacobians[1]);
    put_pose(derivatives.board_pose, blocks[2], weight_, jacobians[2]);
    put_bend(derivatives.bend, weight_, jacobians[3]);
    return true;
  }

 private:
  LensModel model_;
  BoardShape shape_;
  Vector2d p_board_, px_;
  double weight_;
};

// Parameter blocks: camera values, camera pose, board pose, bend, projector values, projector pose.
class MatchCost final : public ceres::CostFunction {
 public:
  MatchCost(const LensModel& camera,
            const LensModel& projector,
            const BoardShape& shape,
            const Match& match,
            double weight)
      : camera_(camera), projector_(projector), shape_(shape), match_(match), weight_(weight) {
    set_num_residuals(2);
    *mutable_parameter_block_sizes() = {camera.value_count(), 7, 7, 2, projector.value_count(), 7};
  }
  bool Evaluate(double const* const* blocks, double* residuals, double** jacobians) const override {
    const Pose camera_from_world = PoseBlock::read(blocks[1]),
               projector_from_world = PoseBlock::read(blocks[5]);
    const ImagerView camera{
        camera_, {blocks[0], static_cast<size_t>(camera_.value_count())}, camera_from_world};
    const ImagerView projector{
        projector_, {blocks[4], static_cast<size_t>(projector_.value_count())}, projector_from_world};
    Derivatives derivatives;
    Vector2d px;
    if (!predict_match(camera, projector, PoseBlock::read(blocks[2]), shape_,
                       Vector2d(blocks[3][0], blocks[3][1]), match_.px_camera, &px,
                       jacobians ? &derivatives : nullptr))
      return false;
    Eigen::Map<Vector2d>{residuals} = weight_ * (px - match_.px_projector);
    if (!jacobians) return true;
    put_values(derivatives.camera_values, weight_, jacobians[0]);
    put_pose(derivatives.camera_pose, blocks[1], weight_, jacobians[1]);
    put_pose(derivatives.board_pose, blocks[2], weight_, jacobians[2]);
    put_bend(derivatives.bend, weight_, jacobians[3]);
    put_values(derivatives.projector_values, weight_, jacobians[4]);
    put_pose(derivatives.projector_pose, blocks[5], weight_, jacobians[5]);
    return true;
  }

 private:
  LensModel camera_, projector_;
  BoardShape shape_;
  Match match_;
  double weight_;
};

// (weights . (values - expected)) for the values that something is known about, and fy / fx.
class LensPrior final : public ceres::CostFunction {
 public:
  LensPrior(std::vector<double> expected, std::vector<double> weights, double aspect_weight)
      : expected_(std::move(expected)), weights_(std::move(weights)), aspect_weight_(aspect_weight) {
    set_num_residuals(static_cast<int>(weights_.size()) + 1);
    *mutable_parameter_block_sizes() = {static_cast<int>(weights_.size())};
  }
  bool Evaluate(double const* const* blocks, double* residuals, double** jacobians) const override {
    const size_t n = weights_.size();
    const double* v = blocks[0];
    for (size_t i = 0; i < n; ++i) residuals[i] = weights_[i] * (v[i] - expected_[i]);
    residuals[n] = aspect_weight_ * std::log(std::abs(v[1] / v[0]));
    if (!jacobians || !jacobians[0]) return true;
    std::fill_n(jacobians[0], n * (n + 1), 0.0);
    for (size_t i = 0; i < n; ++i) jacobians[0][i * n + i] = weights_[i];
    jacobians[0][n * n] = -aspect_weight_ / v[0];
    jacobians[0][n * n + 1] = aspect_weight_ / v[1];
    return true;
  }

 private:
  std::vector<double> expected_, weights_;
  double aspect_weight_;
};

class BendPrior final : public ceres::SizedCostFunction<2, 2> {
 public:
  explicit BendPrior(double weight) : weight_(weight) {}
  bool Evaluate(double const* const* blocks, double* residuals, double** jacobians) const override {
    for (int i = 0; i < 2; ++i) residuals[i] = weight_ * blocks[0][i];
    if (jacobians && jacobians[0])
      Eigen::Map<Eigen::Matrix2d>{jacobians[0]} = weight_ * Eigen::Matrix2d::Identity();
    return true;
  }

 private:
  double weight_;
};

// All unknowns.
struct Unknowns {
  std::vector<std::vector<double>> camera_values, projector_values;
  std::vector<PoseBlock> camera_poses, projector_poses, board_poses;
  std::vector<bool> board_known;
  double bend[2] = {0, 0};
};

// OPENCVn's order: fx fy cx cy k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4
bool is_tangential(size_t value) { return value == 6 || value == 7 || value >= 12; }

LensPrior* lens_prior(const CapturedDevice& device,
                      size_t count,
                      bool is_projector,
                      const SolveOptions& options) {
  std::vector<double> expected(count, 0.0), weights(count, 0.0);
  expected[2] = (device.width - 1) / 2.0;
  expected[3] = (device.height - 1) / 2.0;
  weights[2] = 1 / ((is_projector ? options.projector_centre : options.camera_centre) * device.width);
  weights[3] = is_projector ? 0 : weights[2];
  for (size_t i = 4; i < count; ++i)
    weights[i] = 1 / (is_tangential(i) ? options.tangential : options.radial);
  return new LensPrior(std::move(expected), std::move(weights), 1 / options.aspect);
}

class Joint {
 public:
  Joint(const Observations& observations, const SolveOptions& options, LensModel camera, LensModel projector)
      : observations_(observations),
        options_(options),
        camera_(std::move(camera)),
        projector_(std::move(projector)),
        shape_{observations.board.width_m(), observations.board.height_m()} {}

  Result<Solution> run(Unknowns unknowns) {
    unknowns_ = std::move(unknowns);
    LIMN_TRY_STATUS(check_finite());
    // Three rounds: how much everything scatters is known only after a fit; then it sets the weights.
    double corner_noise = k_first_noise_px, match_noise = k_first_noise_px;
    Solution solution;
    int iterations = 0;
    for (int round = 0; round < 3; ++round) {
      LIMN_TRY(const int used, minimise(corner_noise, match_noise));
      iterations += used;
      solution = evaluated(corner_noise, match_noise);
      corner_noise = noise_of(solution.corner_residuals);
      match_noise = noise_of(solution.match_residuals);
    }
    solution.iterations = iterations;
    solution.covariance = covariance(corner_noise, match_noise);
    if (!solution.covariance.allFinite())
      return error(
          "the joint solve leaves devices undetermined: their covariance is not finite. Capture more poses, "
          "tilted by 20 to 45 degrees to different sides.");
    return solution;
  }

  // Of a single board pose, everything else fixed; from corners alone.
  Result<Pose> refine_board(Unknowns unknowns, int pose, double corner_noise) {
    unknowns_ = std::move(unknowns);
    LIMN_TRY_STATUS(check_finite());
    ceres::Problem problem(problem_options());
    add_corners(&problem, corner_noise, pose);
    fix_all_but_board(&problem, pose);
    LIMN_TRY_STATUS(run_ceres(&problem).status);
    return unknowns_.board_poses[static_cast<size_t>(pose)].pose();
  }

 private:
  static constexpr double k_first_noise_px = 0.2;
  static constexpr double k_least_noise_px = 0.01;

  struct Outcome {
    Status status;
    int iterations = 0;
  };

  // Ceres ends the program on values that are not finite.
  Status check_finite() const {
    bool finite = true;
    for (const auto* lists : {&unknowns_.camera_values, &unknowns_.projector_values}) {
      for (const auto& values : *lists) {
        for (const double v : values) finite = finite && std::isfinite(v);
      }
    }
    for (const auto* poses : {&unknowns_.camera_poses, &unknowns_.projector_poses, &unknowns_.board_poses}) {
      for (const PoseBlock& block : *poses) finite = finite && block.pose().is_finite();
    }
    if (finite) return {};
    return error(
        "the joint solve has no finite start: the observations do not determine the devices. Capture more "
        "poses, tilted by 20 to 45 degrees to different sides.");
  }

  static ceres::Problem::Options problem_options() {
    ceres::Problem::Options options;
    options.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    return options;
  }

  ceres::LossFunction* loss() { return &loss_; }

  void add_corners(ceres::Problem* problem, double noise, int only_pose) {
    for (const CornerSeen& seen : observations_.corners) {
      const auto camera = static_cast<size_t>(seen.camera), pose = static_cast<size_t>(seen.pose);
      if (!unknowns_.board_known[pose] || (only_pose >= 0 && seen.pose != only_pose)) continue;
      const Vector2d p_board = observations_.board.p_corner(seen.corner).head<2>();
      problem->AddResidualBlock(
          new CornerCost(camera_, shape_, p_board, seen.px, 1 / std::hypot(seen.stddev_px, noise)), loss(),
          unknowns_.camera_values[camera].data(), unknowns_.camera_poses[camera].v,
          unknowns_.board_poses[pose].v, unknowns_.bend);
    }
  }

  void add_matches(ceres::Problem* problem, double noise) {
    for (const Match& match : observations_.matches) {
      const auto camera = static_cast<size_t>(match.camera), pose = static_cast<size_t>(match.pose),
                 projector = static_cast<size_t>(match.projector);
      if (!unknowns_.board_known[pose]) continue;
      problem->AddResidualBlock(
          new MatchCost(camera_, projector_, shape_, match, 1 / std::hypot(match.stddev_px, noise)), loss(),
          unknowns_.camera_values[camera].data(), unknowns_.camera_poses[camera].v,
          unknowns_.board_poses[pose].v, unknowns_.bend, unknowns_.projector_values[projector].data(),
          unknowns_.projector_poses[projector].v);
    }
  }

  void add_priors(ceres::Problem* problem) {
    for (size_t i = 0; i < unknowns_.camera_values.size(); ++i)
      problem->AddResidualBlock(
          lens_prior(observations_.cameras[i], unknowns_.camera_values[i].size(), false, options_), nullptr,
          unknowns_.camera_values[i].data());
    for (size_t i = 0; i < unknowns_.projector_values.size(); ++i)
      problem->AddResidualBlock(
          lens_prior(observations_.projectors[i], unknowns_.projector_values[i].size(), true, options_),
          nullptr, unknowns_.projector_values[i].data());
    problem->AddResidualBlock(new BendPrior(1 / (options_.bend_share * shape_.width_m)), nullptr,
                              unknowns_.bend);
  }

  void set_manifolds(ceres::Problem* problem) {
    for (auto* poses : {&unknowns_.camera_poses, &unknowns_.projector_poses, &unknowns_.board_poses}) {
      for (PoseBlock& pose : *poses) {
        if (problem->HasParameterBlock(pose.v)) problem->SetManifold(pose.v, &manifold_);
      }
    }
  }

  void fix_all_but_board(ceres::Problem* problem, int pose) {
    set_manifolds(problem);
    std::vector<double*> blocks;
    problem->GetParameterBlocks(&blocks);
    for (double* block : blocks) {
      if (block != unknowns_.board_poses[static_cast<size_t>(pose)].v)
        problem->SetParameterBlockConstant(block);
    }
  }

  Outcome run_ceres(ceres::Problem* problem) {
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::DENSE_NORMAL_CHOLESKY;
    options.max_num_iterations = 200;
    options.function_tolerance = 1e-10;
    options.gradient_tolerance = 1e-12;
    options.parameter_tolerance = 1e-12;
    options.num_threads = 1;  // the sums' order, and so the last bits, never change
    options.logging_type = ceres::SILENT;
    ceres::Solver::Summary summary;
    ceres::Solve(options, problem, &summary);
    const int used = static_cast<int>(summary.iterations.size());
    const bool finite = std::isfinite(summary.final_cost);
    if (summary.termination_type == ceres::CONVERGENCE && finite) return {{}, used};
    // A valley: steps that no observation feels. The covariance says how long it is.
    constexpr double k_unfelt = 1e-4;  // of the cost, in the last step
    if (summary.termination_type == ceres::NO_CONVERGENCE && finite &&
        std::abs(summary.iterations.back().cost_change) < k_unfelt * summary.final_cost)
      return {{}, used};
    return {error("the joint solve did not converge in {} steps: {} Check the board's description, leave out "
                  "doubtful "
                  "poses (--skip-poses), capture more poses.",
                  used, summary.message),
            used};
  }

  Result<int> minimise(double corner_noise, double match_noise) {
    ceres::Problem problem(problem_options());
    fill(&problem, corner_noise, match_noise);
    const Outcome outcome = run_ceres(&problem);
    LIMN_TRY_STATUS(outcome.status);
    return outcome.iterations;
  }

  void fill(ceres::Problem* problem, double corner_noise, double match_noise) {
    add_corners(problem, corner_noise, -1);
    add_matches(problem, match_noise);
    add_priors(problem);
    set_manifolds(problem);
    problem->SetParameterBlockConstant(unknowns_.camera_poses[0].v);
    if (!options_.bend) problem->SetParameterBlockConstant(unknowns_.bend);
  }

  // The devices' part of the inverse of J^T J. Few unknowns, many rows: the normal matrix is dense, its sum
  // runs over the sparse rows.
  Eigen::MatrixXd covariance(double corner_noise, double match_noise) {
    ceres::Problem problem(problem_options());
    fill(&problem, corner_noise, match_noise);
    std::vector<double*> blocks;
    std::vector<int> device_columns;  // of each unknown of the devices in `blocks`; -1: fixed
    int columns = 0;
    const auto take = [&](double* block, bool is_device) {
      const bool free = problem.HasParameterBlock(block) && !problem.IsParameterBlockConstant(block);
      const int size = problem.HasParameterBlock(block) ? problem.ParameterBlockTangentSize(block) : 6;
      for (int i = 0; i < size && is_device; ++i) device_columns.push_back(free ? columns + i : -1);
      if (!free) return;
      blocks.push_back(block);
      columns += size;
    };
    for (size_t i = 0; i < unknowns_.camera_values.size(); ++i) {
      take(unknowns_.camera_values[i].data(), true);
      take(unknowns_.camera_poses[i].v, true);
    }
    for (size_t i = 0; i < unknowns_.projector_values.size(); ++i) {
      take(unknowns_.projector_values[i].data(), true);
      take(unknowns_.projector_poses[i].v, true);
    }
    for (PoseBlock& pose : unknowns_.board_poses) take(pose.v, false);
    take(unknowns_.bend, false);
    ceres::Problem::EvaluateOptions options;
    options.parameter_blocks = blocks;
    ceres::CRSMatrix jacobian;
    if (!problem.Evaluate(options, nullptr, nullptr, nullptr, &jacobian)) return {};
    return devices_of(jacobian, device_columns);
  }

  static Eigen::MatrixXd devices_of(const ceres::CRSMatrix& jacobian, const std::vector<int>& columns) {
    Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(jacobian.num_cols, jacobian.num_cols);
    for (size_t row = 0; row + 1 < jacobian.rows.size(); ++row) {
      const auto from = static_cast<size_t>(jacobian.rows[row]),
                 to = static_cast<size_t>(jacobian.rows[row + 1]);
      for (size_t i = from; i < to; ++i) {
        for (size_t k = from; k < to; ++k)
          normal(jacobian.cols[i], jacobian.cols[k]) += jacobian.values[i] * jacobian.values[k];
      }
    }
    // Unknowns of very different sizes: scaled to a unit diagonal before the inverse.
    const Eigen::VectorXd scale =
        normal.diagonal().cwiseMax(std::numeric_limits<double>::min()).cwiseSqrt().cwiseInverse();
    const Eigen::MatrixXd scaled = scale.asDiagonal() * normal * scale.asDiagonal();
    const Eigen::MatrixXd inverse =
        scale.asDiagonal() * scaled.ldlt().solve(Eigen::MatrixXd::Identity(normal.rows(), normal.cols())) *
        scale.asDiagonal();
    const auto count = static_cast<Eigen::Index>(columns.size());
    Eigen::MatrixXd devices = Eigen::MatrixXd::Zero(count, count);
    for (Eigen::Index i = 0; i < count; ++i) {
      for (Eigen::Index k = 0; k < count; ++k) {
        const int a = columns[static_cast<size_t>(i)], b = columns[static_cast<size_t>(k)];
        if (a >= 0 && b >= 0) devices(i, k) = inverse(a, b);
      }
    }
    return devices;
  }

  // Standard deviation of one coordinate by the median of |residual| (of a 2-D normal: 1.1774 sigma).
  static double noise_of(const std::vector<Vector2d>& residuals) {
    std::vector<double> lengths;
    for (const Vector2d& r : residuals) {
      if (r.allFinite()) lengths.push_back(r.norm());
    }
    if (lengths.empty()) return k_first_noise_px;
    const auto middle = lengths.begin() + static_cast<std::ptrdiff_t>(lengths.size() / 2);
    std::nth_element(lengths.begin(), middle, lengths.end());
    return std::max(*middle / 1.1774, k_least_noise_px);
  }

  Imager imager(const CapturedDevice& device,
                const LensModel& model,
                const std::vector<double>& values,
                const PoseBlock& pose) {
    Imager made;
    made.name = device.name;
    made.width = device.width;
    made.height = device.height;
    made.lens.model = model;
    made.lens.values = values;
    made.imager_from_world = pose.pose();
    return made;
  }

  Solution evaluated(double corner_noise, double match_noise) {
    Solution solution;
    for (size_t i = 0; i < unknowns_.camera_values.size(); ++i)
      solution.rig.cameras.push_back(
          imager(observations_.cameras[i], camera_, unknowns_.camera_values[i], unknowns_.camera_poses[i]));
    for (size_t i = 0; i < unknowns_.projector_values.size(); ++i)
      solution.rig.projectors.push_back(imager(observations_.projectors[i], projector_,
                                               unknowns_.projector_values[i], unknowns_.projector_poses[i]));
    for (size_t i = 0; i < unknowns_.board_poses.size(); ++i)
      solution.world_from_board.push_back(
          unknowns_.board_known[i] ? std::optional(unknowns_.board_poses[i].pose()) : std::nullopt);
    solution.bend_m = {unknowns_.bend[0], unknowns_.bend[1]};
    const Vector2d none = Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
    for (const CornerSeen& seen : observations_.corners) {
      const Imager& camera = solution.rig.cameras[static_cast<size_t>(seen.camera)];
      const auto& pose = solution.world_from_board[static_cast<size_t>(seen.pose)];
      Vector2d px, r = none;
      if (pose &&
          predict_corner({camera.lens.model, camera.lens.values, camera.imager_from_world}, *pose, shape_,
                         solution.bend_m, observations_.board.p_corner(seen.corner).head<2>(), &px))
        r = px - seen.px;
      solution.corner_residuals.push_back(r);
      solution.corner_outlier.push_back(
          !(r.norm() < k_outlier_at * std::hypot(seen.stddev_px, corner_noise)));
    }
    for (const Match& match : observations_.matches) {
      const auto& pose = solution.world_from_board[static_cast<size_t>(match.pose)];
      const auto px = pose ? predicted(observations_, solution, *pose, match) : std::nullopt;
      const Vector2d r = px ? Vector2d(*px - match.px_projector) : none;
      solution.match_residuals.push_back(r);
      solution.match_outlier.push_back(!(r.norm() < k_outlier_at * std::hypot(match.stddev_px, match_noise)));
    }
    solution.corner_noise_px = corner_noise;
    solution.match_noise_px = match_noise;
    return solution;
  }

  const Observations& observations_;
  SolveOptions options_;
  LensModel camera_, projector_;
  BoardShape shape_;
  Unknowns unknowns_;
  PoseManifold manifold_;
  ceres::CauchyLoss loss_{options_.robust_at};
};

Unknowns unknowns_of(const std::vector<Imager>& cameras,
                     const std::vector<Imager>& projectors,
                     const std::vector<std::optional<Pose>>& boards) {
  Unknowns unknowns;
  for (const Imager& camera : cameras) {
    unknowns.camera_values.push_back(camera.lens.values);
    unknowns.camera_poses.emplace_back(camera.imager_from_world);
  }
  for (const Imager& projector : projectors) {
    unknowns.projector_values.push_back(projector.lens.values);
    unknowns.projector_poses.emplace_back(projector.imager_from_world);
  }
  for (const auto& board : boards) {
    unknowns.board_poses.emplace_back(board.value_or(Pose()));
    unknowns.board_known.push_back(board.has_value());
  }
  return unknowns;
}

Result<LensModel> solvable(const std::string& name) {
  LIMN_TRY(LensModel model, LensModel::parse(name));
  const int n = model.value_count();
  if (n != 4 && name.rfind("LENSMODEL_OPENCV", 0) != 0)
    return error("lens model '{}': expected LENSMODEL_PINHOLE or LENSMODEL_OPENCV4, 5, 8 or 12.", name);
  return model;
}

// A chessboard that looks the same when turned may be read differently by two cameras.
Status check_board(const Observations& observations) {
  const Board& board = observations.board;
  const bool ambiguous = board.kind == BoardKind::chessboard && (board.columns + board.rows) % 2 == 0;
  if (ambiguous && observations.cameras.size() > 1)
    return error(
        "board {}: looks the same when turned by 180 degrees, so {} cameras cannot agree on its corners. Use "
        "a ChArUco board, or a chessboard with one even and one odd number of corners.",
        board.text(), observations.cameras.size());
  return {};
}

}  // namespace

int Solution::projector_at(size_t projector) const {
  int at = 0;
  for (const Imager& camera : rig.cameras) at += camera.lens.model.value_count() + 6;
  for (size_t i = 0; i < projector; ++i) at += rig.projectors[i].lens.model.value_count() + 6;
  return at;
}

Result<Solution> solve(const Observations& observations, const SolveOptions& options, const Solution* start) {
  LIMN_TRY(const LensModel camera_model, solvable(options.camera_model));
  LIMN_TRY(const LensModel projector_model, solvable(options.projector_model));
  LIMN_TRY_STATUS(check_board(observations));
  Joint joint(observations, options, camera_model, projector_model);
  if (start) {
    std::vector<std::optional<Pose>> boards = start->world_from_board;
    for (size_t i = 0; i < boards.size(); ++i) {
      const bool seen = std::any_of(observations.corners.begin(), observations.corners.end(),
                                    [&](const CornerSeen& c) { return static_cast<size_t>(c.pose) == i; });
      if (!seen) boards[i].reset();
    }
    Unknowns unknowns = unknowns_of(start->rig.cameras, start->rig.projectors, boards);
    unknowns.bend[0] = start->bend_m.x();
    unknowns.bend[1] = start->bend_m.y();
    return joint.run(std::move(unknowns));
  }
  LIMN_TRY(const Seed seeded, seed(observations, camera_model, projector_model));
  return joint.run(unknowns_of(seeded.cameras, seeded.projectors, seeded.world_from_board));
}

Result<Pose> board_pose_from_cameras(const Observations& observations, const Solution& solution, int pose) {
  const Rig& rig = solution.rig;
  const Imager& camera = rig.cameras.front();
  Observations only = observations;
  std::erase_if(only.corners, [&](const CornerSeen& corner) { return corner.pose != pose; });
  LIMN_TRY(const Pose first, board_pose_seed(only, rig));
  std::vector<std::optional<Pose>> boards(observations.poses.size());
  boards[static_cast<size_t>(pose)] = first;
  Unknowns unknowns = unknowns_of(rig.cameras, rig.projectors, boards);
  unknowns.bend[0] = solution.bend_m.x();
  unknowns.bend[1] = solution.bend_m.y();
  Joint joint(observations, {}, camera.lens.model, rig.projectors.front().lens.model);
  return joint.refine_board(std::move(unknowns), pose, solution.corner_noise_px);
}

std::optional<Vector2d> predicted(const Observations& observations,
                                  const Solution& solution,
                                  const Pose& world_from_board,
                                  const Match& match) {
  const Imager& camera = solution.rig.cameras[static_cast<size_t>(match.camera)];
  const Imager& projector = solution.rig.projectors[static_cast<size_t>(match.projector)];
  Vector2d px;
  if (!predict_match({camera.lens.model, camera.lens.values, camera.imager_from_world},
                     {projector.lens.model, projector.lens.values, projector.imager_from_world},
                     world_from_board, {observations.board.width_m(), observations.board.height_m()},
                     solution.bend_m, match.px_camera, &px))
    return std::nullopt;
  return px;
}

std::optional<Eigen::Vector3d> surface_point(const Observations& observations,
                                             const Solution& solution,
                                             const Pose& world_from_board,
                                             const Match& match) {
  const Imager& camera = solution.rig.cameras[static_cast<size_t>(match.camera)];
  Eigen::Vector3d p;
  if (!meet_board({camera.lens.model, camera.lens.values, camera.imager_from_world}, world_from_board,
                  {observations.board.width_m(), observations.board.height_m()}, solution.bend_m,
                  match.px_camera, &p))
    return std::nullopt;
  return p;
}

}  // namespace limn::calib
