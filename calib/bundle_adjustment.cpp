#include "calib/bundle_adjustment.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <tuple>

#include "calib/solve.h"
#include "core/least_squares.h"
#include "core/linear_algebra.h"

namespace limn::calib {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;

// An observation without a prediction counts as this many standard deviations.
constexpr double k_unseen = 1e4;
constexpr int k_most_steps = 200;
constexpr double k_settled = 1e-10;  // share of the cost: a step that promises less is the last
// The board's twist as a share of its width where the print is not solved: none. As an unknown, it led solves
// of damaged captures to wrong minima.
constexpr double k_no_twist_share = 1e-7;
constexpr double k_first_damping = 1e-6, k_least_damping = 1e-12, k_most_damping = 1e10;

ImagerView view(const Imager& imager) {
  return {imager.lens.model, imager.lens.values, imager.imager_from_world};
}

int value_count(const Imager& imager) { return imager.lens.model.value_count(); }

// Order of values in OPENCVn: fx fy cx cy k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4.
bool is_tangential(int value) { return value == 6 || value == 7 || value >= 12; }

bool is_finite(const Parameters& parameters) {
  for (const auto* imagers : {&parameters.cameras, &parameters.projectors}) {
    for (const Imager& imager : *imagers) {
      for (const double v : imager.lens.values) {
        if (!std::isfinite(v)) return false;
      }
      if (!imager.imager_from_world.is_finite()) return false;
    }
  }
  for (const auto& board : parameters.world_from_board) {
    if (board && !board->is_finite()) return false;
  }
  return parameters.bend_m.allFinite() && std::isfinite(parameters.twist_m) && parameters.print.allFinite();
}

}  // namespace

BundleAdjuster::BundleAdjuster(const Observations& observations, const SolveOptions& options, int left_out)
    : observations_(observations),
      options_(options),
      left_out_(left_out),
      match_rays_(observations.matches.size()),
      point_rays_(observations.points.size()) {
  group_observations();
}

void BundleAdjuster::group_observations() {
  std::map<std::tuple<int, int, int>, Group> groups;  // pose, projector, camera
  const auto assign = [&](int pose, int projector, int camera, size_t member) {
    if (pose == left_out_) return;
    Group& group = groups[{pose, projector, camera}];
    group.camera = camera;
    group.projector = projector;
    group.pose = pose;
    group.members.push_back(member);
  };
  for (size_t i = 0; i < observations_.corners.size(); ++i)
    assign(observations_.corners[i].pose, -1, observations_.corners[i].camera, i);
  for (size_t i = 0; i < observations_.matches.size(); ++i) {
    const Match& match = observations_.matches[i];
    assign(match.pose, match.projector, match.camera, i);
  }
  for (auto& [key, group] : groups) groups_.push_back(std::move(group));
}

// Cauchy's loss of the squared length of a residual.
double BundleAdjuster::robust_weight(double squared, NormalEquations* normal) const {
  const CauchyLoss loss(options_.robust_at);
  const double weight = loss.weight(squared);
  normal->cost += loss.cost(squared) / 2;
  normal->weight += weight;
  normal->curvature += weight - squared * weight * weight / loss.square_limit;
  normal->slope += weight * weight * squared / 2;
  normal->count += 1;
  return weight;
}

void BundleAdjuster::add_group(const Group& group,
                               const Parameters& at,
                               const Noise& noise,
                               NormalEquations* normal) {
  const auto& board = at.world_from_board[static_cast<size_t>(group.pose)];
  if (!board) return;
  const Imager& camera = at.cameras[static_cast<size_t>(group.camera)];
  const bool is_match = group.projector >= 0;
  const Imager* projector = is_match ? &at.projectors[static_cast<size_t>(group.projector)] : nullptr;
  const ImagerView camera_view = view(camera);
  const BoardShape bent = shape(at);
  // Columns: camera values, camera pose, board, projector values, projector pose; the board's pose last.
  const int n = value_count(camera), m = is_match ? value_count(*projector) : 0;
  const int projector_column = n + 6 + board_count_;
  const int board_at = projector_column + (is_match ? m + 6 : 0), columns = board_at + 6;
  MatrixXd rows = MatrixXd::Zero(static_cast<Eigen::Index>(2 * group.members.size()), columns);
  VectorXd residuals = VectorXd::Zero(rows.rows());
  Derivatives d;
  for (size_t i = 0; i < group.members.size(); ++i) {
    Vector2d px, measured;
    double stddev = 0;
    bool seen = false;
    if (is_match) {
      const Match& match = observations_.matches[group.members[i]];
      LensRay& ray = match_rays_[group.members[i]];
      measured = match.px_projector;
      stddev = noise.match.total(match.stddev_px);
      seen = find_ray(camera.lens.model, camera.lens.values, match.px_camera, true, &ray) &&
             predict_match(camera_view, view(*projector), *board, bent, at.bend_m, ray, &px, &d);
    } else {
      const CornerObservation& corner = observations_.corners[group.members[i]];
      const Vector2d p_board = printed_corner(observations_.board, at.print, corner.corner);
      measured = corner.px;
      stddev = noise.corner.total(corner.stddev_px);
      seen = predict_corner(camera_view, *board, bent, at.bend_m, p_board, &px, &d);
    }
    if (!seen) {
      robust_weight(k_unseen * k_unseen, normal);
      continue;
    }
    const Vector2d residual = (px - measured) / stddev;
    const double scale = std::sqrt(robust_weight(residual.squaredNorm(), normal));
    const auto row = static_cast<Eigen::Index>(2 * i);
    residuals.segment<2>(row) = scale * residual;
    const double factor = scale / stddev;
    rows.block(row, 0, 2, n) = factor * d.camera_values;
    rows.block<2, 6>(row, n) = factor * d.camera_pose;
    rows.block<2, 2>(row, n + 6) = factor * d.bend;
    rows.block<2, 1>(row, n + 8) = factor * d.twist;
    if (!is_match && board_count_ > 3)
      rows.block<2, k_print_modes>(row, n + 9) =
          factor * d.board_xy *
          print_modes(observations_.board,
                      observations_.board.p_corner(observations_.corners[group.members[i]].corner).head<2>());
    if (is_match) {
      rows.block(row, projector_column, 2, m) = factor * d.projector_values;
      rows.block<2, 6>(row, projector_column + m) = factor * d.projector_pose;
    }
    rows.block<2, 6>(row, board_at) = factor * d.board_pose;
  }
  MatrixXd local = MatrixXd::Zero(columns, columns);
  local.selfadjointView<Eigen::Lower>().rankUpdate(rows.transpose());
  const VectorXd gradient = rows.transpose() * residuals;

  // Maps local columns to the parameters' indices.
  struct Part {
    int from, to, size;
  };
  std::vector<Part> parts = {{0, camera_at_[static_cast<size_t>(group.camera)], n + 6},
                             {n + 6, board_at_, board_count_}};
  if (is_match)
    parts.push_back({projector_column, projector_at_[static_cast<size_t>(group.projector)], m + 6});
  Eliminated& own = normal->boards[static_cast<size_t>(group.pose)];
  for (const Part& a : parts) {
    for (const Part& b : parts) {
      if (a.from == b.from) {
        normal->devices.block(a.to, a.to, a.size, a.size) += local.block(a.from, a.from, a.size, a.size);
      } else if (a.to > b.to) {  // the lower half; local's lies below its own diagonal
        if (a.from > b.from)
          normal->devices.block(a.to, b.to, a.size, b.size) += local.block(a.from, b.from, a.size, b.size);
        else
          normal->devices.block(a.to, b.to, a.size, b.size) +=
              local.block(b.from, a.from, b.size, a.size).transpose();
      }
    }
    own.cross.middleCols(a.to, a.size) += local.block(board_at, a.from, 6, a.size);
    normal->gradient.segment(a.to, a.size) += gradient.segment(a.from, a.size);
  }
  own.own += local.bottomRightCorner<6, 6>();
  own.gradient += gradient.tail<6>();
}

void BundleAdjuster::add_points(const Parameters& at, const Noise& noise, NormalEquations* normal) {
  TiePointDerivatives d;
  MatrixXd rows;
  for (size_t i = 0; i < observations_.tie_observations.size();) {
    const auto index = static_cast<size_t>(observations_.tie_observations[i].point);
    size_t end = i;
    while (end < observations_.tie_observations.size() &&
           static_cast<size_t>(observations_.tie_observations[end].point) == index)
      ++end;
    const size_t begin = i;
    i = end;
    const double inverse_depth = at.inverse_depths[index];
    const TiePoint& point = observations_.points[index];
    if (inverse_depth == 0 || point.pose == left_out_) continue;
    const Imager& camera = at.cameras[static_cast<size_t>(point.camera)];
    LensRay& ray = point_rays_[index];
    const bool has_ray = find_ray(camera.lens.model, camera.lens.values, point.px_camera, true, &ray);
    const int n = value_count(camera), camera_at = camera_at_[static_cast<size_t>(point.camera)];
    rows.setZero(static_cast<Eigen::Index>(2 * (end - begin)), normal->gradient.size() + 1);
    VectorXd residuals = VectorXd::Zero(rows.rows());
    for (size_t k = begin; k < end; ++k) {
      const TiePointObservation& tie_observation = observations_.tie_observations[k];
      const auto which = static_cast<size_t>(tie_observation.imager);
      const Imager& seeing = tie_observation.by_projector ? at.projectors[which] : at.cameras[which];
      const int seeing_at = tie_observation.by_projector ? projector_at_[which] : camera_at_[which];
      Vector2d px;
      if (!has_ray || !predict_tie_point(view(camera), view(seeing), ray, inverse_depth, &px, &d)) {
        robust_weight(k_unseen * k_unseen, normal);
        continue;
      }
      const double stddev = noise.tie_point.total(tie_observation.stddev_px);
      const Vector2d residual = (px - tie_observation.px) / stddev;
      const double scale = std::sqrt(robust_weight(residual.squaredNorm(), normal)), factor = scale / stddev;
      const auto row = static_cast<Eigen::Index>(2 * (k - begin));
      residuals.segment<2>(row) = scale * residual;
      rows.block(row, camera_at, 2, n) = factor * d.camera_values;
      rows.block<2, 6>(row, camera_at + n) = factor * d.camera_pose;
      rows.block(row, seeing_at, 2, value_count(seeing)) = factor * d.values;
      rows.block<2, 6>(row, seeing_at + value_count(seeing)) = factor * d.pose;
      rows.block<2, 1>(row, rows.cols() - 1) = factor * d.inverse_depth;
    }
    const auto devices = rows.leftCols(rows.cols() - 1);
    const VectorXd depth = rows.rightCols<1>();
    normal->devices.selfadjointView<Eigen::Lower>().rankUpdate(devices.transpose());
    normal->gradient += devices.transpose() * residuals;
    normal->points[index] = {MatrixXd::Constant(1, 1, depth.squaredNorm()), depth.transpose() * devices,
                             VectorXd::Constant(1, depth.dot(residuals))};
  }
}

void BundleAdjuster::add_lens_prior(const Imager& imager,
                                    bool is_projector,
                                    int at,
                                    NormalEquations* normal) const {
  const auto add = [&](int value, double expected, double stddev) {
    const double residual = (imager.lens.values[static_cast<size_t>(value)] - expected) / stddev;
    normal->cost += residual * residual / 2;
    normal->devices(at + value, at + value) += 1 / (stddev * stddev);
    normal->gradient(at + value) += residual / stddev;
  };
  add(2, (imager.width - 1) / 2.0,
      (is_projector ? options_.projector_centre : options_.camera_centre) * imager.width);
  if (!is_projector) add(3, (imager.height - 1) / 2.0, options_.camera_centre * imager.width);
  for (int i = 4; i < value_count(imager); ++i)
    add(i, 0,
        is_tangential(i) ? (is_projector ? options_.projector_tangential : options_.tangential)
                         : (is_projector ? options_.projector_radial : options_.radial));
  const double fx = imager.lens.fx(), fy = imager.lens.fy();
  const double stddev = !is_projector && options_.square_pixels ? k_square_pixels : options_.aspect;
  const double residual = std::log(std::abs(fy / fx)) / stddev;
  const Vector2d slope(-1 / (fx * stddev), 1 / (fy * stddev));
  normal->cost += residual * residual / 2;
  normal->devices.block<2, 2>(at, at) += slope * slope.transpose();
  normal->gradient.segment<2>(at) += residual * slope;
}

BoardShape BundleAdjuster::shape(const Parameters& at) const {
  return {observations_.board.width_m(), observations_.board.height_m(), at.twist_m};
}

// The print's prior, its size by known lengths, and the lengths that were measured by hand.
void BundleAdjuster::add_print_priors(const Parameters& at, NormalEquations* normal) const {
  const int at_print = board_at_ + 3;
  const double size = options_.print_size > 0 ? options_.print_size : k_print_size;
  const VectorXd weights = print_stddevs(observations_.board, size).cwiseInverse();
  const VectorXd off = weights.cwiseProduct(at.print);
  normal->cost += off.squaredNorm() / 2;
  normal->devices.block<k_print_modes, k_print_modes>(at_print, at_print).diagonal() += weights.cwiseAbs2();
  normal->gradient.segment<k_print_modes>(at_print) += weights.cwiseProduct(off);
  if (options_.known_growth) {
    const PrintModes by = by_print(observations_.board);
    const Vector2d nominal = nominal_lengths(observations_.board);
    const Eigen::RowVectorXd slope =
        (by.row(0) / nominal.x() + by.row(1) / nominal.y()) / 2 / options_.known_growth->stddev;
    const double residual = slope.dot(at.print) - options_.known_growth->mean / options_.known_growth->stddev;
    normal->cost += residual * residual / 2;
    normal->devices.block<k_print_modes, k_print_modes>(at_print, at_print) += slope.transpose() * slope;
    normal->gradient.segment<k_print_modes>(at_print) += slope.transpose() * residual;
  }
  if (!options_.board_measured) return;
  const BoardMeasured& measured = *options_.board_measured;
  const PrintModes by = by_print(observations_.board) / measured.stddev_m;
  const Vector2d residual =
      by * at.print + (nominal_lengths(observations_.board) - Vector2d(measured.width_m, measured.height_m)) /
                          measured.stddev_m;
  normal->cost += residual.squaredNorm() / 2;
  normal->devices.block<k_print_modes, k_print_modes>(at_print, at_print) += by.transpose() * by;
  normal->gradient.segment<k_print_modes>(at_print) += by.transpose() * residual;
}

void BundleAdjuster::add_priors(const Parameters& at, NormalEquations* normal) const {
  for (size_t i = 0; i < at.cameras.size(); ++i) add_lens_prior(at.cameras[i], false, camera_at_[i], normal);
  for (size_t i = 0; i < at.projectors.size(); ++i)
    add_lens_prior(at.projectors[i], true, projector_at_[i], normal);
  const Vector3d bends(at.bend_m.x(), at.bend_m.y(), at.twist_m);
  const double twist_share = at.print.size() > 0 ? options_.bend_share : k_no_twist_share;
  const Vector3d weights = 1 / (Eigen::Array3d(options_.bend_share, options_.bend_share, twist_share) *
                                observations_.board.width_m());
  const Vector3d squares = weights.cwiseAbs2();
  normal->cost += bends.cwiseAbs2().dot(squares) / 2;
  normal->devices.block<3, 3>(board_at_, board_at_).diagonal() += squares;
  normal->gradient.segment<3>(board_at_) += squares.cwiseProduct(bends);
  if (at.print.size() > 0) add_print_priors(at, normal);
}

BundleAdjuster::NormalEquations BundleAdjuster::evaluate(const Parameters& at, const Noise& noise) {
  NormalEquations normal;
  const int size = board_at_ + board_count_;
  normal.cost = 0;
  normal.devices = MatrixXd::Zero(size, size);
  normal.gradient = VectorXd::Zero(size);
  normal.boards.assign(at.world_from_board.size(),
                       {MatrixXd::Zero(6, 6), MatrixXd::Zero(6, size), VectorXd::Zero(6)});
  normal.points.assign(observations_.points.size(), {});
  if (!is_finite(at)) {
    normal.cost = std::numeric_limits<double>::infinity();
    return normal;
  }
  for (const Group& group : groups_) add_group(group, at, noise, &normal);
  add_points(at, noise, &normal);
  add_priors(at, &normal);
  for (int i = 0; i < size; ++i) {  // fixed parameters: no movement, no influence
    if (free_[static_cast<size_t>(i)]) continue;
    normal.devices.row(i).setZero();
    normal.devices.col(i).setZero();
    normal.devices(i, i) = 1;
    normal.gradient(i) = 0;
    for (auto* list : {&normal.boards, &normal.points}) {
      for (Eliminated& own : *list) {
        if (own.cross.cols() > 0) own.cross.col(i).setZero();
      }
    }
  }
  return normal;
}

MatrixXd BundleAdjuster::reduced(const NormalEquations& normal, double damping, VectorXd* gradient) const {
  MatrixXd schur = normal.devices;
  schur.diagonal() *= 1 + damping;
  *gradient = normal.gradient;
  for (const auto* list : {&normal.boards, &normal.points}) {
    for (const Eliminated& own : *list) {
      if (own.own.rows() == 0 || !(own.own.diagonal().minCoeff() > 0)) continue;
      MatrixXd damped = own.own;
      damped.diagonal() *= 1 + damping;
      const auto factor = damped.llt();
      if (factor.info() != Eigen::Success) continue;
      const MatrixXd half = factor.matrixL().solve(own.cross);
      schur.selfadjointView<Eigen::Lower>().rankUpdate(half.transpose(), -1);
      *gradient -= half.transpose() * factor.matrixL().solve(own.gradient);
    }
  }
  return schur;
}

std::optional<BundleAdjuster::Step> BundleAdjuster::step(const NormalEquations& normal,
                                                         double damping) const {
  Step step;
  VectorXd gradient;
  const MatrixXd schur = reduced(normal, damping, &gradient);
  // The parameters have very different sizes, so the matrix is scaled to a unit diagonal.
  if (!(schur.diagonal().minCoeff() > 0)) return std::nullopt;
  const VectorXd scale = schur.diagonal().cwiseSqrt().cwiseInverse();
  const MatrixXd scaled = scale.asDiagonal() * schur * scale.asDiagonal();
  const Eigen::LLT<MatrixXd, Eigen::Lower> factor(scaled);
  if (factor.info() != Eigen::Success) return std::nullopt;
  step.devices = -(scale.asDiagonal() * factor.solve(scale.cwiseProduct(gradient)));
  const auto promise = [&](const VectorXd& delta, const VectorXd& slope, const VectorXd& diagonal) {
    step.promised += (damping * delta.cwiseAbs2().dot(diagonal) - delta.dot(slope)) / 2;
  };
  promise(step.devices, normal.gradient, normal.devices.diagonal());
  const auto back = [&](const std::vector<Eliminated>& list, std::vector<VectorXd>* deltas) {
    for (const Eliminated& own : list) {
      deltas->push_back(VectorXd::Zero(own.own.rows()));
      if (own.own.rows() == 0 || !(own.own.diagonal().minCoeff() > 0)) continue;
      MatrixXd damped = own.own;
      damped.diagonal() *= 1 + damping;
      const auto block = damped.llt();
      if (block.info() != Eigen::Success) continue;
      deltas->back() = -block.solve(own.gradient + own.cross * step.devices);
      promise(deltas->back(), own.gradient, own.own.diagonal());
    }
  };
  back(normal.boards, &step.boards);
  back(normal.points, &step.points);
  if (!step.devices.allFinite() || !std::isfinite(step.promised)) return std::nullopt;
  return step;
}

Parameters BundleAdjuster::moved(const Parameters& from, const Step& step) const {
  Parameters to = from;
  const auto move = [&](Imager* imager, int at) {
    const int n = value_count(*imager);
    for (int i = 0; i < n; ++i) imager->lens.values[static_cast<size_t>(i)] += step.devices(at + i);
    imager->imager_from_world = boxplus(imager->imager_from_world, step.devices.segment<6>(at + n));
  };
  for (size_t i = 0; i < to.cameras.size(); ++i) {
    const Pose pose = to.cameras[i].imager_from_world;
    move(&to.cameras[i], camera_at_[i]);
    if (i == 0) to.cameras[i].imager_from_world = pose;  // it defines the world and is not even rounded
  }
  for (size_t i = 0; i < to.projectors.size(); ++i) move(&to.projectors[i], projector_at_[i]);
  to.bend_m += step.devices.segment<2>(board_at_);
  to.twist_m += step.devices(board_at_ + 2);
  if (to.print.size() > 0) to.print += step.devices.segment<k_print_modes>(board_at_ + 3);
  for (size_t i = 0; i < to.world_from_board.size(); ++i) {
    if (to.world_from_board[i])
      to.world_from_board[i] = boxplus(*to.world_from_board[i], Vector6d(step.boards[i]));
  }
  for (size_t i = 0; i < to.inverse_depths.size(); ++i) {
    if (step.points[i].size() > 0) to.inverse_depths[i] += step.points[i](0);
  }
  return to;
}

// Initial depths: the mean of what the observations give.
void BundleAdjuster::place_points(Parameters* parameters) const {
  parameters->inverse_depths.assign(observations_.points.size(), 0.0);
  std::vector<double> sums(observations_.points.size(), 0.0);
  std::vector<int> counts(observations_.points.size(), 0);
  for (const TiePointObservation& tie_observation : observations_.tie_observations) {
    const auto index = static_cast<size_t>(tie_observation.point),
               which = static_cast<size_t>(tie_observation.imager);
    const TiePoint& point = observations_.points[index];
    const Imager& camera = parameters->cameras[static_cast<size_t>(point.camera)];
    const Imager& seeing =
        tie_observation.by_projector ? parameters->projectors[which] : parameters->cameras[which];
    LensRay ray;
    if (!find_ray(camera.lens.model, camera.lens.values, point.px_camera, false, &ray)) continue;
    const double depth = triangulated_depth(view(camera), ray, view(seeing), tie_observation.px);
    if (!(depth > 0)) continue;
    sums[index] += 1 / depth;
    ++counts[index];
  }
  for (size_t i = 0; i < sums.size(); ++i) {
    if (counts[i] > 0) parameters->inverse_depths[i] = sums[i] / counts[i];
  }
}

// The whole problem for minimise(). The equations come with the cost.
struct BundleAdjuster::Problem {
  BundleAdjuster& joint;
  const Noise& noise;
  double enough = 0;
  Parameters here;
  NormalEquations at_here;
  Parameters there{};
  NormalEquations at_there{};
  Step step{};
  double last_gain = 1;  // decrease of the cost in the last accepted step

  double cost() const { return at_here.cost; }
  bool solve(double damping) {
    std::optional<Step> found = joint.step(at_here, damping);
    if (found) step = std::move(*found);
    return found.has_value();
  }
  double evaluate_trial() {
    there = joint.moved(here, step);
    at_there = joint.evaluate(there, noise);
    return at_there.cost;
  }
  void accept_trial() {
    last_gain = (at_here.cost - at_there.cost) / std::max(at_here.cost, k_to_rounding);
    here = std::move(there);
    at_here = std::move(at_there);
  }
  bool is_settled(const LeastSquaresTrial& tried) const {
    return step.promised < k_settled * tried.cost_before + enough;
  }
};

void BundleAdjuster::index_parameters(const Parameters& of) {
  camera_at_.clear();
  projector_at_.clear();
  int size = 0;
  for (const Imager& camera : of.cameras) {
    camera_at_.push_back(size);
    size += value_count(camera) + 6;
  }
  for (const Imager& projector : of.projectors) {
    projector_at_.push_back(size);
    size += value_count(projector) + 6;
  }
  board_at_ = size;
  board_count_ = 3 + static_cast<int>(of.print.size());
  free_.assign(static_cast<size_t>(size + board_count_), true);
  for (int i = 0; i < 6; ++i) free_[static_cast<size_t>(value_count(of.cameras[0]) + i)] = false;
  if (!options_.bend) std::fill_n(free_.begin() + size, 3, false);
}

Result<BundleAdjuster::Summary> BundleAdjuster::minimise(Parameters start,
                                                         const Noise& noise,
                                                         double enough) {
  const bool solves_print = options_.board_measured || options_.known_growth || options_.print_size > 0;
  if (!solves_print) start.print.resize(0);
  if (solves_print && start.print.size() == 0) start.print = VectorXd::Zero(k_print_modes);
  index_parameters(start);
  if (start.inverse_depths.size() != observations_.points.size()) place_points(&start);

  NormalEquations at_start = evaluate(start, noise);
  Problem problem{.joint = *this,
                  .noise = noise,
                  .enough = enough,
                  .here = std::move(start),
                  .at_here = std::move(at_start)};
  const LeastSquaresSummary found = limn::minimise(&problem, {.max_steps = k_most_steps,
                                                              .first_damping = k_first_damping,
                                                              .least_damping = k_least_damping,
                                                              .most_damping = k_most_damping,
                                                              .damps_more_without_step = true});
  if (found.end == LeastSquaresEnd::no_start)
    return error(
        "the bundle adjustment has no finite start: the observations do not determine the devices. Capture "
        "more "
        "poses, tilted by 20 to 45 degrees to different sides.");
  const bool converged = found.end == LeastSquaresEnd::settled;
  // A flat valley: steps change the cost by less than this. The covariance states its length.
  constexpr double k_flat = 1e-4;  // share of the cost, in the last step
  if (converged || problem.last_gain < k_flat)
    return Summary{std::move(problem.here), found.steps, converged, found.cost};
  return error(
      "the joint solve did not converge in {} steps. Check the board's description, leave out doubtful poses "
      "(--skip-poses), capture more poses.",
      found.steps);
}

MatrixXd BundleAdjuster::covariance(Parameters at, const Noise& noise) {
  index_parameters(at);
  if (at.inverse_depths.size() != observations_.points.size()) place_points(&at);
  const NormalEquations normal = evaluate(at, noise);
  VectorXd gradient;
  MatrixXd schur = reduced(normal, 0, &gradient);
  schur = schur.selfadjointView<Eigen::Lower>();
  const VectorXd scale =
      schur.diagonal().cwiseMax(std::numeric_limits<double>::min()).cwiseSqrt().cwiseInverse();
  const MatrixXd scaled = scale.asDiagonal() * schur * scale.asDiagonal();
  MatrixXd inverse = scale.asDiagonal() *
                     scaled.ldlt().solve(MatrixXd::Identity(schur.rows(), schur.cols())) * scale.asDiagonal();
  const double robust = normal.weight * normal.slope / std::max(normal.curvature * normal.curvature, 1e-300);
  for (int i = 0; i < board_at_; ++i) {
    if (free_[static_cast<size_t>(i)]) continue;
    inverse.row(i).setZero();
    inverse.col(i).setZero();
  }
  return robust * inverse.topLeftCorner(board_at_, board_at_);
}

// One placement of the board by its corners, for minimise().
struct BundleAdjuster::BoardProblem {
  struct Equations {
    double cost = 0;
    Matrix6d matrix = Matrix6d::Zero();
    Vector6d gradient = Vector6d::Zero();
  };
  const BundleAdjuster& joint;
  const Parameters& at;
  int pose;
  const Noise& noise;
  Pose state, trial{};
  Equations at_state{}, at_trial{};
  Vector6d delta{};
  double promised = 0;

  Equations evaluate(const Pose& world_from_board) const {
    Equations sums;
    NormalEquations robust;
    robust.cost = 0;
    Derivatives d;
    for (const CornerObservation& corner : joint.observations_.corners) {
      if (corner.pose != pose) continue;
      const Imager& camera = at.cameras[static_cast<size_t>(corner.camera)];
      const double stddev = noise.corner.total(corner.stddev_px);
      Vector2d px;
      if (!predict_corner(view(camera), world_from_board, joint.shape(at), at.bend_m,
                          printed_corner(joint.observations_.board, at.print, corner.corner), &px, &d)) {
        joint.robust_weight(k_unseen * k_unseen, &robust);
        continue;
      }
      const Vector2d residual = (px - corner.px) / stddev;
      const double weight = joint.robust_weight(residual.squaredNorm(), &robust);
      sums.matrix += weight / (stddev * stddev) * d.board_pose.transpose() * d.board_pose;
      sums.gradient += weight / stddev * d.board_pose.transpose() * residual;
    }
    sums.cost = robust.cost;
    return sums;
  }
  double cost() const { return at_state.cost; }
  bool solve(double damping) {
    delta = -solve_ldlt(damped(at_state.matrix, damping), at_state.gradient);
    promised = -delta.dot(at_state.gradient) / 2;
    return delta.allFinite();
  }
  double evaluate_trial() {
    trial = boxplus(state, delta);
    at_trial = evaluate(trial);
    return at_trial.cost;
  }
  void accept_trial() {
    state = trial;
    at_state = at_trial;
  }
  bool is_settled(const LeastSquaresTrial& tried) const {
    return promised < k_settled * tried.cost_before + k_to_rounding;
  }
};

Result<Pose> BundleAdjuster::board_pose(const Parameters& at,
                                        int pose,
                                        const Noise& noise,
                                        const Pose& start) const {
  BoardProblem problem{.joint = *this, .at = at, .pose = pose, .noise = noise, .state = start};
  problem.at_state = problem.evaluate(start);
  const LeastSquaresSummary found = limn::minimise(&problem, {.max_steps = k_most_steps,
                                                              .first_damping = k_first_damping,
                                                              .least_damping = k_least_damping,
                                                              .most_damping = k_most_damping});
  if (found.end == LeastSquaresEnd::settled) return problem.state;
  return error("{}: the board's pose does not follow from its corners.",
               observations_.poses[static_cast<size_t>(pose)]);
}

}  // namespace limn::calib
