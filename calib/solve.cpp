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
// Lower limits of the estimated noise: perfect observations would have infinite weights.
constexpr double k_least_noise_px = 0.005, k_least_scale = 0.25;
constexpr double k_rayleigh_median = 1.1774;  // median length of a residual, standard deviations
// Distortion that projectors' lenses may have although none was found.
constexpr double k_pinhole_radial = 0.1, k_pinhole_tangential = 0.002;
constexpr int k_rounds = 3;  // the noise is known only after a fit; it sets the next fit's weights

ImagerView view(const Imager& imager) {
  return {imager.lens.model, imager.lens.values, imager.imager_from_world};
}

// An observation's deviation, scaled so that its median is the standard deviation of one coordinate, and the
// standard deviation that it states.
struct Deviation {
  double px = 0, stated_px = 0;
};

// The level at which the median deviation is as large as stated.
NoiseLevel level_of(const std::vector<Deviation>& deviations, const NoiseLevel& otherwise) {
  if (deviations.empty()) return otherwise;
  const auto median_at = [&](const NoiseLevel& level) {
    std::vector<double> ratios;
    for (const Deviation& d : deviations) ratios.push_back(d.px / level.total(d.stated_px));
    return median(std::move(ratios));
  };
  NoiseLevel level{k_least_noise_px, 1};
  if (const double ratio = median_at(level); ratio < 1) {
    level.scale = std::max(ratio, k_least_scale);
    return level;
  }
  double high = 1e3;
  constexpr int k_halvings = 50;
  for (int i = 0; i < k_halvings; ++i) {  // halves the logarithm's interval
    const double middle = std::sqrt(level.common_px * high);
    (median_at({middle, 1}) > 1 ? level.common_px : high) = middle;
  }
  return level;
}

template <class Seen>
NoiseLevel level_of(const std::vector<Seen>& observations,
                    const std::vector<Vector2d>& residuals,
                    const NoiseLevel& otherwise) {
  std::vector<Deviation> deviations;
  for (size_t i = 0; i < residuals.size(); ++i) {
    if (residuals[i].allFinite())
      deviations.push_back({residuals[i].norm() / k_rayleigh_median, observations[i].stddev_px});
  }
  return level_of(deviations, otherwise);
}

std::vector<Deviation> without_stated(const std::vector<Vector2d>& residuals) {
  std::vector<Deviation> deviations;
  for (const Vector2d& r : residuals) {
    if (r.allFinite()) deviations.push_back({r.norm() / k_rayleigh_median, 0});
  }
  return deviations;
}

// The tie point's own depth uses one degree of freedom of its observations; the median of the remaining sum
// of squares is Wilson's and Hilferty's.
NoiseLevel tie_point_level(const Observations& observations, const std::vector<Vector2d>& residuals) {
  std::vector<Deviation> deviations;
  for (size_t i = 0; i < residuals.size();) {
    const int point = observations.tie_observations[i].point;
    double squares = 0, stated = 0;
    int degrees = -1;
    for (; i < residuals.size() && observations.tie_observations[i].point == point; ++i) {
      if (!residuals[i].allFinite()) continue;
      squares += residuals[i].squaredNorm();
      stated += 2 * std::pow(observations.tie_observations[i].stddev_px, 2);
      degrees += 2;
    }
    if (degrees < 1) continue;
    deviations.push_back({std::sqrt(squares / degrees / std::pow(1 - 2.0 / (9 * degrees), 3)),
                          std::sqrt(stated / (degrees + 1))});
  }
  return level_of(deviations, {});
}

Solution solution_at(const Parameters& parameters, const Noise& noise, int steps) {
  Solution solution;
  solution.rig.cameras = parameters.cameras;
  solution.rig.projectors = parameters.projectors;
  solution.world_from_board = parameters.world_from_board;
  solution.bend_m = parameters.bend_m;
  solution.twist_m = parameters.twist_m;
  solution.print = parameters.print;
  solution.noise = noise;
  solution.iterations = steps;
  return solution;
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
  const BoardShape shape = board_shape(observations, *into);
  const Vector2d none = Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
  const auto is_outlier = [](const Vector2d& r, double stddev) {
    return !(r.norm() < k_outlier_at * stddev);
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
                               printed_corner(observations.board, into->print, seen.corner), &px))
      r = px - seen.px;
    into->corner_residuals.push_back(r);
    into->corner_outlier.push_back(is_outlier(r, noise.corner.total(seen.stddev_px)));
  }
  for (const Match& match : observations.matches) {
    const auto& pose = into->world_from_board[static_cast<size_t>(match.pose)];
    const auto px = pose ? predicted(observations, *into, *pose, match) : std::nullopt;
    const Vector2d r = px ? Vector2d(*px - match.px_projector) : none;
    into->match_residuals.push_back(r);
    into->match_outlier.push_back(is_outlier(r, noise.match.total(match.stddev_px)));
  }
  into->corner_scatter_px = level_of(without_stated(into->corner_residuals), {}).common_px;
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
    const Noise found{level_of(observations.corners, solution.corner_residuals, noise.corner),
                      level_of(observations.matches, solution.match_residuals, noise.match),
                      tie_point_level(observations, solution.tie_point_residuals)};
    if (is_last) {
      solution.noise = found;
      solution.print_is_measured = options.board_measured || options.known_growth;
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
  parameters.twist_m = solution.twist_m;
  parameters.print = solution.print;
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

// fy / fx - 1 of camera 0, and its standard deviation.
struct PixelAspect {
  double value = 0, stddev = 0;
};
PixelAspect pixel_aspect(const Solution& solution) {
  const Lens& lens = solution.rig.cameras[0].lens;
  const Vector2d slope(-lens.fy() / (lens.fx() * lens.fx()), 1 / lens.fx());
  return {lens.fy() / lens.fx() - 1, std::sqrt(slope.dot(solution.covariance.topLeftCorner<2, 2>() * slope))};
}

bool has_pinhole(const Rig& rig) {
  const auto is_pinhole = [](const Imager& imager) { return imager.lens.model.value_count() == 4; };
  return std::any_of(rig.cameras.begin(), rig.cameras.end(), is_pinhole) ||
         std::any_of(rig.projectors.begin(), rig.projectors.end(), is_pinhole);
}

// What costs less than a tenth of a millimetre of light.
constexpr double k_least_aspect = 4e-4, k_least_smooth_m = 0.03e-3;
constexpr double k_least_print_size = 7e-4;  // share; see calib_stated, "badly printed"
constexpr double k_better_fit = 0.9;  // share of the corners' scatter; chance changes it by a hundredth

bool are_square(const PixelAspect& pixels) {
  constexpr double k_far = 3;  // standard deviations
  return std::abs(pixels.value) <= k_far * pixels.stddev + k_square_pixels;
}

// Whether camera 0's pixels, which seem to be uneven, are square once the print's errors are unknowns.
bool is_aspect_of_print(const PixelAspect& seen, const PixelAspect& freed) {
  constexpr double k_certain = 4;  // standard deviations
  const double size = std::abs(seen.value);
  return size >= std::max(k_least_aspect, k_certain * seen.stddev) && k_certain * freed.stddev < size &&
         are_square(freed);
}

}  // namespace

std::vector<std::string> lens_models(const Observations& observations, const SolveOptions& options) {
  if (!options.lens_models.empty()) return options.lens_models;
  std::vector<std::string> names(observations.cameras.size(), options.camera_model);
  names.resize(names.size() + observations.projectors.size(), options.projector_model);
  return names;
}

int Solution::camera_at(size_t camera) const {
  int at = 0;
  for (size_t i = 0; i < camera; ++i) at += rig.cameras[i].lens.model.value_count() + 6;
  return at;
}

int Solution::projector_at(size_t projector) const {
  int at = camera_at(rig.cameras.size());
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
  return rounds(observations, options, std::move(parameters), start.noise);
}

Result<Solution> solve_again(const Observations& observations,
                             const SolveOptions& options,
                             const Solution& start,
                             int left_out,
                             bool to_rounding) {
  LIMN_TRY(Parameters parameters, unknowns_with_models(observations, options, start));
  const Noise noise = start.noise;
  if (left_out >= 0) parameters.world_from_board[static_cast<size_t>(left_out)].reset();
  BundleAdjuster joint(observations, options, left_out);
  LIMN_TRY(const BundleAdjuster::Summary descent,
           joint.minimise(std::move(parameters), noise,
                          to_rounding ? BundleAdjuster::k_to_rounding : BundleAdjuster::k_to_significance));
  return solution_at(descent.parameters, noise, descent.steps);
}

Rig with_distortion_values(Rig rig) {
  static const LensModel k_distorted = LensModel::parse("LENSMODEL_OPENCV4").value();
  for (auto* imagers : {&rig.cameras, &rig.projectors}) {
    for (Imager& imager : *imagers) {
      if (imager.lens.model.value_count() == 4) imager.lens = with_model(imager.lens, k_distorted);
    }
  }
  return rig;
}

UnevenPrint uneven_print(const Observations& observations,
                         const SolveOptions& options,
                         const Solution& solution) {
  if (observations.board.is_exact || options.board_measured) return {};
  SolveOptions free = options;
  free.print_size = k_print_size;
  const auto freed = solve_from(observations, free, solution);
  if (!freed) return {};
  const Vector2d growth = print_growth(observations.board, freed->print);
  const double aspect = std::abs(growth.x() - growth.y()), smooth_m = smooth_error_m(freed->print);
  const bool is_visible = aspect > k_least_aspect || smooth_m > k_least_smooth_m;
  const bool fits_better = freed->corner_scatter_px < k_better_fit * solution.corner_scatter_px;
  const PixelAspect pixels = pixel_aspect(*freed);
  const bool is_shown_by_pixels = is_aspect_of_print(pixel_aspect(solution), pixels);
  if (!is_shown_by_pixels && !(is_visible && fits_better)) return {};
  // Smooth errors also lengthen the sheet, by about as much as they bend its lines. Two sides that are wrong
  // alike show little: an uneven print is as uncertain as office printers are, at least.
  const double half_m = (observations.board.width_m() + observations.board.height_m()) / 4;
  return {std::hypot(aspect, std::sqrt(3.0) * smooth_m / half_m, k_least_print_size), are_square(pixels),
          is_shown_by_pixels};
}

BoardShape board_shape(const Observations& observations, const Solution& solution) {
  return {observations.board.width_m(), observations.board.height_m(), solution.twist_m};
}

SolveOptions unknown_distortion(const Solution& solution, SolveOptions options) {
  if (!has_pinhole(solution.rig)) return options;
  options.projector_radial = k_pinhole_radial;
  options.projector_tangential = k_pinhole_tangential;
  return options;
}

Solution with_distortion_unknown(const Observations& observations,
                                 Solution solution,
                                 const SolveOptions& options) {
  if (!has_pinhole(solution.rig)) return solution;
  const SolveOptions judging = unknown_distortion(solution, options);
  solution.rig = with_distortion_values(std::move(solution.rig));
  solution.covariance =
      BundleAdjuster(observations, judging).covariance(unknowns_of(solution), solution.noise);
  return solution;
}

Eigen::MatrixXd covariance_without(const Observations& observations,
                                   const Solution& solution,
                                   const SolveOptions& options,
                                   int pose) {
  return BundleAdjuster(observations, options, pose).covariance(unknowns_of(solution), solution.noise);
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
  return joint.board_pose(unknowns_of(solution), pose, solution.noise, first);
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
                     world_from_board, board_shape(observations, solution), solution.bend_m, match.px_camera,
                     &px))
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
                       board_shape(observations, solution), solution.bend_m, match.px_camera, &p))
    return std::nullopt;
  return p;
}

}  // namespace limn::calib
