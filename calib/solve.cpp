#include "calib/solve.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

#include "calib/bundle_adjustment.h"
#include "calib/seed.h"
#include "core/median.h"

namespace limn::calib {
namespace {

using Eigen::Vector2d;

constexpr double k_outlier_at = 4;  // standard deviations: one in 3000 of correct observations
constexpr double k_least_noise_px = 0.01;
constexpr int k_rounds = 3;  // the noise is known only after a fit; it sets the next fit's weights

ImagerView view(const Imager& imager) {
  return {imager.lens.model, imager.lens.values, imager.imager_from_world};
}

// Standard deviation of one coordinate by the median of |residual| (of a 2-D normal: 1.1774 sigma).
double median_noise(std::vector<double> deviations, double otherwise) {
  if (deviations.empty()) return otherwise;
  return std::max(median(std::move(deviations)), k_least_noise_px);
}

double noise_of(const std::vector<Vector2d>& residuals) {
  std::vector<double> deviations;
  for (const Vector2d& r : residuals) {
    if (r.allFinite()) deviations.push_back(r.norm() / 1.1774);  // Rayleigh's median
  }
  return median_noise(std::move(deviations), Noise().corner_px);
}

// The tie point's own depth uses one degree of freedom of its observations; the median of the remaining sum
// of squares is Wilson's and Hilferty's.
double tie_point_noise(const Observations& observations, const std::vector<Vector2d>& residuals) {
  std::vector<double> deviations;
  for (size_t i = 0; i < residuals.size();) {
    const int point = observations.tie_observations[i].point;
    double squares = 0;
    int degrees = -1;
    for (; i < residuals.size() && observations.tie_observations[i].point == point; ++i) {
      if (!residuals[i].allFinite()) continue;
      squares += residuals[i].squaredNorm();
      degrees += 2;
    }
    if (degrees < 1) continue;
    deviations.push_back(std::sqrt(squares / degrees / std::pow(1 - 2.0 / (9 * degrees), 3)));
  }
  return median_noise(std::move(deviations), Noise().tie_point_px);
}

Solution solution_at(const Parameters& parameters, const Noise& noise, int steps) {
  Solution solution;
  solution.rig.cameras = parameters.cameras;
  solution.rig.projectors = parameters.projectors;
  solution.world_from_board = parameters.world_from_board;
  solution.bend_m = parameters.bend_m;
  solution.corner_noise_px = noise.corner_px;
  solution.match_noise_px = noise.match_px;
  solution.tie_point_noise_px = noise.tie_point_px;
  solution.iterations = steps;
  return solution;
}

Noise noise_of(const Solution& solution) {
  return {solution.corner_noise_px, solution.match_noise_px, solution.tie_point_noise_px};
}

std::vector<std::optional<Eigen::Vector3d>> places_of(const Observations& observations,
                                                      const Parameters& at) {
  std::vector<std::optional<Eigen::Vector3d>> places;
  for (size_t i = 0; i < observations.points.size(); ++i) {
    const TiePoint& point = observations.points[i];
    const Imager& camera = at.cameras[static_cast<size_t>(point.camera)];
    LensRay ray;
    const double inverse_depth = at.inverse_depths[i];
    const bool placed =
        inverse_depth > 0 && find_ray(camera.lens.model, camera.lens.values, point.px_camera, false, &ray);
    places.push_back(
        placed ? std::optional<Eigen::Vector3d>(camera.imager_from_world.inverse() * (ray.d / inverse_depth))
               : std::nullopt);
  }
  return places;
}

void add_residuals(const Observations& observations,
                   const Parameters& at,
                   const Noise& noise,
                   Solution* into) {
  const BoardShape shape{observations.board.width_m(), observations.board.height_m()};
  const Vector2d none = Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
  const auto is_outlier = [](const Vector2d& r, double own, double common) {
    return !(r.norm() < k_outlier_at * std::hypot(own, common));
  };
  into->corner_residuals.clear();
  into->match_residuals.clear();
  into->corner_outlier.clear();
  into->match_outlier.clear();
  into->tie_point_residuals.clear();
  for (const CornerObservation& seen : observations.corners) {
    const auto& pose = into->world_from_board[static_cast<size_t>(seen.pose)];
    const Imager& camera = into->rig.cameras[static_cast<size_t>(seen.camera)];
    Vector2d px, r = none;
    if (pose && predict_corner(view(camera), *pose, shape, into->bend_m,
                               observations.board.p_corner(seen.corner).head<2>(), &px))
      r = px - seen.px;
    into->corner_residuals.push_back(r);
    into->corner_outlier.push_back(is_outlier(r, seen.stddev_px, noise.corner_px));
  }
  for (const Match& match : observations.matches) {
    const auto& pose = into->world_from_board[static_cast<size_t>(match.pose)];
    const auto px = pose ? predicted(observations, *into, *pose, match) : std::nullopt;
    const Vector2d r = px ? Vector2d(*px - match.px_projector) : none;
    into->match_residuals.push_back(r);
    into->match_outlier.push_back(is_outlier(r, match.stddev_px, noise.match_px));
  }
  into->points = places_of(observations, at);
  for (const TiePointObservation& tie_observation : observations.tie_observations) {
    const auto& p = into->points[static_cast<size_t>(tie_observation.point)];
    const auto& imagers = tie_observation.by_projector ? into->rig.projectors : into->rig.cameras;
    const auto px = p ? imagers[static_cast<size_t>(tie_observation.imager)].project(*p) : std::nullopt;
    into->tie_point_residuals.push_back(px ? Vector2d(*px - tie_observation.px) : none);
  }
}

// Iteratively reweighted bundle adjustment: refits k_rounds times, each time with the noise estimated from
// the last residuals.
Result<Solution> rounds(const Observations& observations,
                        const SolveOptions& options,
                        Parameters start,
                        Noise noise) {
  BundleAdjuster joint(observations, options);
  Solution solution;
  int steps = 0;
  for (int round = 0;; ++round) {
    const bool is_last = round == k_rounds - 1;
    LIMN_TRY(BundleAdjuster::Summary descent,
             joint.minimise(std::move(start), noise,
                            is_last ? BundleAdjuster::k_to_rounding : BundleAdjuster::k_to_significance));
    steps += descent.steps;
    solution = solution_at(descent.parameters, noise, steps);
    add_residuals(observations, descent.parameters, noise, &solution);
    const Noise found{noise_of(solution.corner_residuals),
                      observations.matches.empty() ? noise.match_px : noise_of(solution.match_residuals),
                      tie_point_noise(observations, solution.tie_point_residuals)};
    if (is_last) {
      solution.covariance = joint.covariance(descent.parameters, found);
      break;
    }
    noise = found;
    start = std::move(descent.parameters);
  }
  if (!solution.covariance.allFinite())
    return error(
        "the bundle adjustment does not determine all devices: their covariance is not finite. Capture more "
        "poses, tilted by 20 to 45 degrees to different sides.");
  return solution;
}

Result<LensModel> solvable(const std::string& name) {
  LIMN_TRY(LensModel model, LensModel::parse(name));
  const int n = model.value_count();
  if ((n != 4 && name.rfind("LENSMODEL_OPENCV", 0) != 0) || n > k_most_values)
    return error("lens model '{}': expected LENSMODEL_PINHOLE or LENSMODEL_OPENCV4, 5, 8 or 12.", name);
  return model;
}

struct Models {
  std::vector<LensModel> cameras, projectors;
};

Result<Models> models_of(const Observations& observations, const SolveOptions& options) {
  Models models;
  const std::vector<std::string> names = lens_models(observations, options);
  if (names.size() != observations.cameras.size() + observations.projectors.size())
    return error("lens models: expected one for each of {} cameras and {} projectors, found {}.",
                 observations.cameras.size(), observations.projectors.size(), names.size());
  for (const std::string& name : names) {
    LIMN_TRY(LensModel model, solvable(name));
    (models.cameras.size() < observations.cameras.size() ? models.cameras : models.projectors)
        .push_back(std::move(model));
  }
  return models;
}

// A chessboard that looks the same when turned may be read differently by two cameras.
Status check_board_symmetry(const Observations& observations) {
  const Board& board = observations.board;
  if (board.is_ambiguous() && observations.cameras.size() > 1)
    return error(
        "board {}: looks the same when turned by 180 degrees, so {} cameras cannot agree on its corners. Use "
        "a ChArUco board, or a chessboard with one even and one odd number of corners, or an asymmetric grid "
        "with "
        "an odd number of rows.",
        board.text(), observations.cameras.size());
  return {};
}

Status check_finite(const Observations& observations) {
  const auto broken = [&](const char* what, int pose) {
    return error("{} of {}: a coordinate is not a finite number. Decode the captures again.", what,
                 observations.poses[static_cast<size_t>(pose)]);
  };
  for (const CornerObservation& seen : observations.corners) {
    if (!seen.px.allFinite() || !std::isfinite(seen.stddev_px)) return broken("a board corner", seen.pose);
  }
  for (const Match& match : observations.matches) {
    if (!match.px_camera.allFinite() || !match.px_projector.allFinite() || !std::isfinite(match.stddev_px))
      return broken("a match", match.pose);
  }
  for (const TiePointObservation& tie_observation : observations.tie_observations) {
    const TiePoint& point = observations.points[static_cast<size_t>(tie_observation.point)];
    if (!tie_observation.px.allFinite() || !point.px_camera.allFinite() ||
        !std::isfinite(tie_observation.stddev_px))
      return broken("a scene point", point.pose);
  }
  return {};
}

// Another lens model with the values that both have; the rest 0.
Lens with_model(const Lens& lens, const LensModel& model) {
  Lens changed{model, lens.values};
  changed.values.resize(static_cast<size_t>(model.value_count()), 0.0);
  return changed;
}

Parameters unknowns_of(const Solution& solution) {
  Parameters parameters;
  parameters.cameras = solution.rig.cameras;
  parameters.projectors = solution.rig.projectors;
  parameters.world_from_board = solution.world_from_board;
  parameters.bend_m = solution.bend_m;
  return parameters;
}

Result<Parameters> unknowns_with_models(const Observations& observations,
                                        const SolveOptions& options,
                                        const Solution& start) {
  LIMN_TRY(const Models models, models_of(observations, options));
  Parameters parameters = unknowns_of(start);
  for (size_t i = 0; i < parameters.cameras.size(); ++i)
    parameters.cameras[i].lens = with_model(parameters.cameras[i].lens, models.cameras[i]);
  for (size_t i = 0; i < parameters.projectors.size(); ++i)
    parameters.projectors[i].lens = with_model(parameters.projectors[i].lens, models.projectors[i]);
  return parameters;
}

}  // namespace

std::vector<std::string> lens_models(const Observations& observations, const SolveOptions& options) {
  if (!options.lens_models.empty()) return options.lens_models;
  std::vector<std::string> names(observations.cameras.size(), options.camera_model);
  names.resize(names.size() + observations.projectors.size(), options.projector_model);
  return names;
}

int Solution::projector_at(size_t projector) const {
  int at = 0;
  for (const Imager& camera : rig.cameras) at += camera.lens.model.value_count() + 6;
  for (size_t i = 0; i < projector; ++i) at += rig.projectors[i].lens.model.value_count() + 6;
  return at;
}

Result<Solution> solve(const Observations& observations, const SolveOptions& options) {
  LIMN_TRY(const Models models, models_of(observations, options));
  LIMN_TRY_STATUS(check_board_symmetry(observations));
  LIMN_TRY_STATUS(check_finite(observations));
  LIMN_TRY(const Seed seeded, seed(observations, models.cameras, models.projectors));
  Parameters parameters;
  parameters.cameras = seeded.cameras;
  parameters.projectors = seeded.projectors;
  parameters.world_from_board = seeded.world_from_board;
  return rounds(observations, options, std::move(parameters), Noise());
}

Result<Solution> solve_from(const Observations& observations,
                            const SolveOptions& options,
                            const Solution& start) {
  LIMN_TRY(Parameters parameters, unknowns_with_models(observations, options, start));
  return rounds(observations, options, std::move(parameters), noise_of(start));
}

Result<Solution> solve_again(const Observations& observations,
                             const SolveOptions& options,
                             const Solution& start,
                             int left_out,
                             bool to_rounding) {
  LIMN_TRY(Parameters parameters, unknowns_with_models(observations, options, start));
  const Noise noise = noise_of(start);
  if (left_out >= 0) parameters.world_from_board[static_cast<size_t>(left_out)].reset();
  BundleAdjuster joint(observations, options, left_out);
  LIMN_TRY(const BundleAdjuster::Summary descent,
           joint.minimise(std::move(parameters), noise,
                          to_rounding ? BundleAdjuster::k_to_rounding : BundleAdjuster::k_to_significance));
  return solution_at(descent.parameters, noise, descent.steps);
}

Result<Pose> board_pose_from_cameras(const Observations& observations, const Solution& solution, int pose) {
  Observations only;
  only.board = observations.board;
  only.poses = observations.poses;
  for (const CornerObservation& corner : observations.corners) {
    if (corner.pose == pose) only.corners.push_back(corner);
  }
  LIMN_TRY(const Pose first, board_pose_seed(only, solution.rig));
  const SolveOptions options;
  const BundleAdjuster joint(only, options);
  return joint.board_pose(unknowns_of(solution), pose, noise_of(solution), first);
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
  if (!intersect_board({camera.lens.model, camera.lens.values, camera.imager_from_world}, world_from_board,
                       {observations.board.width_m(), observations.board.height_m()}, solution.bend_m,
                       match.px_camera, &p))
    return std::nullopt;
  return p;
}

}  // namespace limn::calib
