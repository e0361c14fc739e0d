#include "calib/online_intrinsics.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "core/least_squares.h"
#include "core/linear_algebra.h"
#include "core/median.h"

namespace limn::calib {
namespace {

constexpr int k_most_view_steps = 30, k_most_rounds = 4;
// Minimum gain in the cost (squares of standard deviations); smaller gains are not significant.
constexpr double k_enough = 1e-3;
constexpr double k_most_view_damping = 1e8;
constexpr double k_fits_share = 0.6;     // share of a view's points that must fit for the view to be trusted
constexpr double k_unsure_share = 0.03;  // share of the focal length; above it others are tried
// Growth of the determinant's natural log that is worth an exchange of views.
constexpr double k_more_information = 0.02;
constexpr double k_contradiction = 30;  // squared Mahalanobis distance, 5 degrees of freedom: 1 in 70 000
constexpr double k_median_square = 2 * std::numbers::ln2;  // median of a squared 2-vector of standard normals
constexpr std::size_t k_least_points = 6;                  // minimum that determines more than the pose
constexpr double k_most_sound = 1e5;                       // px, largest plausible focal length

const LensModel& model() {
  static const LensModel opencv4 = LensModel::parse("LENSMODEL_OPENCV4").value();
  return opencv4;
}

std::array<double, 8> model_values(const Vector5d& v) { return {v[0], v[0], v[1], v[2], v[3], v[4], 0, 0}; }

Eigen::Matrix3d skew(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

// Pixel of p (camera frame) with derivatives; false where it has none.
bool project(const std::array<double, 8>& values,
             const Eigen::Vector3d& p,
             Eigen::Vector2d* px,
             Eigen::Matrix<double, 2, 3, Eigen::RowMajor>* d_p = nullptr,
             Eigen::Matrix<double, 2, 5>* d_lens = nullptr) {
  if (!(p.z() > 1e-6)) return false;
  Eigen::Matrix<double, 2, 8, Eigen::RowMajor> d_values;
  if (!model().project(values, p, px, d_p ? d_p->data() : nullptr, d_lens ? d_values.data() : nullptr) ||
      !px->allFinite())
    return false;
  if (d_lens) *d_lens << d_values.col(0) + d_values.col(1), d_values.middleCols<4>(2);
  return true;
}

// Squared distance of a point's pixel from the predicted one, in standard deviations.
double square_of(const std::array<double, 8>& values, const Pose& pose, const BodyPoint& point) {
  Eigen::Vector2d px;
  if (!project(values, pose * point.p_body, &px)) return std::numeric_limits<double>::infinity();
  const Eigen::Vector2d r = point.px - px;
  return r.dot(point.covariance.inverse() * r);
}

double log_determinant(const Matrix5d& m) {
  const Eigen::LLT<Matrix5d> root(m);
  if (root.info() != Eigen::Success) return -std::numeric_limits<double>::infinity();
  return 2 * root.matrixLLT().diagonal().array().log().sum();
}

// Inverse by a scaled form, because a focal length and k2 differ by orders of magnitude.
Matrix5d inverse_of(const Matrix5d& m) {
  const Vector5d scale = m.diagonal().cwiseSqrt().cwiseInverse();
  const Matrix5d scaled = scale.asDiagonal() * m * scale.asDiagonal();
  return scale.asDiagonal() * scaled.inverse() * scale.asDiagonal();
}

bool is_sound_view(const BodyView& view) {
  return view.points.size() >= k_least_points && view.camera_from_body.is_finite() &&
         std::all_of(view.points.begin(), view.points.end(), [](const BodyPoint& point) {
           return point.p_body.allFinite() && point.px.allFinite() && point.covariance.allFinite() &&
                  point.covariance.determinant() > 0 && point.covariance(0, 0) > 0;
         });
}

}  // namespace

Lens IntrinsicsEstimate::lens() const {
  const auto v = model_values(values);
  Lens lens;
  lens.model = model();
  lens.values.assign(v.begin(), v.end());
  return lens;
}

double IntrinsicsEstimate::focal_stddev_px() const { return std::sqrt(covariance(0, 0)); }

bool IntrinsicsEstimate::is_sound() const {
  if (width < 1 || height < 1 || views < 0 || !values.allFinite() || !covariance.allFinite()) return false;
  const double longest = std::max(width, height);
  if (!(values[0] > 0.1 * longest && values[0] < k_most_sound)) return false;
  if (!(values.segment<2>(1).cwiseAbs().maxCoeff() < 2 * longest)) return false;
  if (!(values.tail<2>().cwiseAbs().maxCoeff() < 10)) return false;
  return covariance.isApprox(covariance.transpose(), 1e-6) && covariance.diagonal().minCoeff() > 0 &&
         std::isfinite(log_determinant(inverse_of(covariance)));
}

std::optional<IntrinsicsEstimate> IntrinsicsEstimate::resized(int w, int h) const {
  if (w < 1 || h < 1 || width < 1 || height < 1) return std::nullopt;
  const double sx = static_cast<double>(w) / width, sy = static_cast<double>(h) / height;
  if (std::abs(sx / sy - 1) > 0.01) return std::nullopt;
  IntrinsicsEstimate out = *this;
  out.width = w;
  out.height = h;
  Vector5d scale;
  scale << sx, sx, sy, 1, 1;
  out.values = scale.cwiseProduct(values);
  out.values[1] += 0.5 * (sx - 1);  // pixel centres are at integers
  out.values[2] += 0.5 * (sy - 1);
  out.covariance = scale.asDiagonal() * covariance * scale.asDiagonal();
  return out;
}

IntrinsicsEstimate prior_intrinsics(int width, int height, const IntrinsicsPrior& expected) {
  IntrinsicsEstimate out{.width = width, .height = height};
  const double longest = std::max(width, height);
  const double focal = 0.5 * longest / std::tan(0.5 * expected.fov_deg * std::numbers::pi / 180);
  out.values << focal, 0.5 * (width - 1), 0.5 * (height - 1), 0, 0;
  Vector5d deviation;
  deviation << expected.focal_share * focal, expected.centre_share * longest, expected.centre_share * longest,
      expected.k1, expected.k2;
  out.covariance = deviation.cwiseAbs2().asDiagonal();
  return out;
}

// Normal equations of one view: l the lens, p the camera's pose (boxplus's perturbation).
struct OnlineIntrinsics::Blocks {
  bool is_whole = true;
  double cost = 0;
  Matrix5d ll = Matrix5d::Zero();
  Eigen::Matrix<double, 5, 6> lp = Eigen::Matrix<double, 5, 6>::Zero();
  Matrix6d pp = Matrix6d::Zero();
  Vector5d l = Vector5d::Zero();
  Vector6d p = Vector6d::Zero();

  // Information of the view about the lens, with its pose eliminated.
  Matrix5d information() const { return ll - lp * pp.ldlt().solve(lp.transpose()); }
};

OnlineIntrinsics::OnlineIntrinsics(const IntrinsicsEstimate& before, const OnlineIntrinsicsOptions& options)
    : before_(before), estimate_(before), options_(options) {
  LIMN_CHECK(before.is_sound());
}

OnlineIntrinsics::Blocks OnlineIntrinsics::blocks(const Vector5d& values,
                                                  const View& view,
                                                  const Pose& pose,
                                                  double noise) const {
  Blocks out;
  const auto lens = model_values(values);
  const CauchyLoss loss(options_.robust_at);
  for (const BodyPoint& point : view.points) {
    const Eigen::Vector3d turned = pose.rotation * point.p_body;
    Eigen::Vector2d px;
    Eigen::Matrix<double, 2, 3, Eigen::RowMajor> d_p;
    Eigen::Matrix<double, 2, 5> d_lens;
    if (!project(lens, turned + pose.translation, &px, &d_p, &d_lens)) {
      out.is_whole = false;
      return out;
    }
    Eigen::Matrix<double, 2, 6> d_place;
    d_place << -d_p * skew(turned), d_p;
    const Eigen::Matrix2d information = point.covariance.inverse() / (noise * noise);
    const Eigen::Vector2d r = point.px - px;
    const double square = r.dot(information * r);
    const double weight = loss.weight(square);
    const Eigen::Matrix<double, 2, 5> weighted_lens = weight * information * d_lens;
    const Eigen::Matrix<double, 2, 6> weighted_place = weight * information * d_place;
    out.cost += loss.cost(square);
    out.ll += d_lens.transpose() * weighted_lens;
    out.lp += d_lens.transpose() * weighted_place;
    out.pp += d_place.transpose() * weighted_place;
    out.l += weighted_lens.transpose() * r;
    out.p += weighted_place.transpose() * r;
  }
  return out;
}

// Estimated by the median, so that points that were moved do not count.
double OnlineIntrinsics::noise_of(const Vector5d& values,
                                  std::span<const View> views,
                                  std::span<const Pose> poses) const {
  std::vector<double> squares;
  const auto lens = model_values(values);
  for (std::size_t i = 0; i < views.size(); ++i)
    for (const BodyPoint& point : views[i].points) squares.push_back(square_of(lens, poses[i], point));
  const auto numbers = 2.0 * static_cast<double>(squares.size());
  const double unknowns = 6.0 * static_cast<double>(views.size());
  const double freedom = std::max(0.25, (numbers - unknowns) / numbers);
  return std::max(1.0, std::sqrt(median(std::move(squares)) / k_median_square / freedom));
}

// The camera's pose for the given lens values, for minimise(). The equations come with the cost.
struct OnlineIntrinsics::PlaceProblem {
  const OnlineIntrinsics& lens;
  const Vector5d& values;
  const View& view;
  double noise = 1;
  Pose pose, next{};
  Blocks now{}, there{};
  Vector6d delta{};

  void start(double with_noise) {
    noise = with_noise;
    now = lens.blocks(values, view, pose, noise);
  }
  double cost() const { return now.is_whole ? now.cost : std::numeric_limits<double>::infinity(); }
  bool solve(double damping) {
    delta = limn::solve_ldlt(damped(now.pp, damping), now.p);
    return delta.allFinite();
  }
  double evaluate_trial() {
    next = boxplus(pose, delta);
    there = lens.blocks(values, view, next, noise);
    return there.is_whole ? there.cost : std::numeric_limits<double>::infinity();
  }
  void accept_trial() {
    pose = next;
    now = there;
  }
  bool is_settled(const LeastSquaresTrial& tried) const {
    return tried.is_accepted && tried.gain() < k_enough;
  }
};

// The camera's pose for the given lens values; nullopt when the view does not fit them.
std::optional<Pose> OnlineIntrinsics::find_pose(const Vector5d& values,
                                                const View& view,
                                                double* noise) const {
  PlaceProblem problem{.lens = *this, .values = values, .view = view, .pose = view.camera_from_body};
  for (int round = 0; round < k_most_rounds; ++round) {
    *noise = noise_of(values, std::span(&view, 1), std::span(&problem.pose, 1));
    problem.start(*noise);
    const LeastSquaresSummary found = minimise(
        &problem,
        {.max_steps = k_most_view_steps, .first_damping = 1e-6, .most_damping = k_most_view_damping});
    if (found.end == LeastSquaresEnd::no_start || found.end == LeastSquaresEnd::no_step ||
        !problem.pose.is_finite())
      return std::nullopt;
  }
  return problem.pose;
}

bool OnlineIntrinsics::add(const BodyView& seen) {
  if (!is_sound_view(seen)) return false;
  View view{seen.camera_from_body, seen.points};
  double noise = 1;
  const auto pose = find_pose(estimate_.values, view, &noise);
  const auto lens = model_values(estimate_.values);
  const double limit = std::pow(options_.robust_at * std::max(noise_, 1.0), 2);
  // While the lens is uncertain, a view's misfit may be an error of the lens.
  const bool is_unsure = estimate_.focal_stddev_px() > k_unsure_share * estimate_.values[0];
  const auto fitting =
      !pose ? 0 : std::count_if(view.points.begin(), view.points.end(), [&](const BodyPoint& p) {
        return square_of(lens, *pose, p) <= limit;
      });
  if (!pose ||
      (!is_unsure && static_cast<double>(fitting) < k_fits_share * static_cast<double>(view.points.size()))) {
    if (!is_unsure && ++misfits_ >= options_.most_misfits) forget();
    return false;
  }
  misfits_ = 0;
  view.camera_from_body = *pose;
  view.information = blocks(estimate_.values, view, *pose, std::max(noise, noise_)).information();
  const auto near = std::find_if(views_.begin(), views_.end(), [&](const View& other) {
    const double way = (other.camera_from_body.inverse().translation - pose->inverse().translation).norm();
    return angle_between(other.camera_from_body.rotation, pose->rotation) < options_.same_angle &&
           way < options_.same_way * pose->translation.norm();
  });
  Matrix5d all = inverse_of(before_.covariance) + view.information;
  for (const View& other : views_) all += other.information;
  if (near == views_.end() && views_.size() < options_.most_views) {
    views_.push_back(std::move(view));
    return true;
  }
  const double held = log_determinant(all - view.information);
  auto worst = near;
  if (near == views_.end())
    worst = std::max_element(views_.begin(), views_.end(), [&](const View& a, const View& b) {
      return log_determinant(all - a.information) < log_determinant(all - b.information);
    });
  if (!(log_determinant(all - worst->information) > held + k_more_information)) return false;
  *worst = std::move(view);
  return true;
}

// The lens with all places, for minimise(): places meet no point of each other, so they are eliminated one by
// one (Schur complement).
struct OnlineIntrinsics::LensProblem {
  const OnlineIntrinsics& lens;
  Matrix5d before;  // information
  Solved at, trial{};
  std::vector<Blocks> now{}, there{};
  Vector5d delta{};
  std::vector<Vector6d> moves{};

  double evaluated(const Solved& solve_views, std::vector<Blocks>* all) const {
    const Vector5d off = solve_views.values - lens.before_.values;
    double cost = off.dot(before * off);
    all->clear();
    for (std::size_t i = 0; i < lens.views_.size(); ++i) {
      all->push_back(lens.blocks(solve_views.values, lens.views_[i], solve_views.poses[i], at.noise));
      if (!all->back().is_whole) return std::numeric_limits<double>::infinity();
      cost += all->back().cost;
    }
    return cost;
  }
  void start(double noise) {
    at.noise = noise;
    at.cost = evaluated(at, &now);
  }
  double cost() const { return at.cost; }
  bool solve(double damping) {
    Matrix5d matrix = before;
    Vector5d gradient = before * (lens.before_.values - at.values);
    std::vector<Matrix6d> inverses;
    for (const Blocks& view : now) {
      inverses.push_back(damped(view.pp, damping).inverse());
      const Eigen::Matrix<double, 5, 6> cross = view.lp * inverses.back();
      matrix += view.ll - cross * view.lp.transpose();
      gradient += view.l - cross * view.p;
    }
    delta = damped(matrix, damping).ldlt().solve(gradient);
    moves.clear();
    for (std::size_t i = 0; i < now.size(); ++i) {
      moves.push_back(inverses[i] * (now[i].p - now[i].lp.transpose() * delta));
      if (!moves.back().allFinite()) return false;
    }
    return delta.allFinite();
  }
  double evaluate_trial() {
    trial = at;
    trial.values += delta;
    for (std::size_t i = 0; i < moves.size(); ++i) trial.poses[i] = boxplus(trial.poses[i], moves[i]);
    trial.cost = trial.values[0] > 0 ? evaluated(trial, &there) : std::numeric_limits<double>::infinity();
    return trial.cost;
  }
  void accept_trial() {
    at = std::move(trial);
    std::swap(now, there);
  }
  bool is_settled(const LeastSquaresTrial& tried) const {
    return tried.is_accepted && tried.gain() < k_enough;
  }
};

std::optional<OnlineIntrinsics::Solved> OnlineIntrinsics::solve_views(Solved start) const {
  LensProblem problem{.lens = *this, .before = inverse_of(before_.covariance), .at = std::move(start)};
  for (int round = 0; round < k_most_rounds; ++round) {
    problem.start(noise_of(problem.at.values, views_, problem.at.poses));
    const LeastSquaresSummary found = minimise(
        &problem,
        {.max_steps = k_most_view_steps, .least_damping = 1e-9, .most_damping = k_most_view_damping});
    if (found.end == LeastSquaresEnd::no_start || found.end == LeastSquaresEnd::no_step) return std::nullopt;
    const double noise = noise_of(problem.at.values, views_, problem.at.poses);
    if (std::abs(noise / problem.at.noise - 1) < 0.05) break;
  }
  return problem.at;
}

// Focal length and distance are correlated, so that far from the truth there are other minima.
std::optional<OnlineIntrinsics::Solved> OnlineIntrinsics::solve_from_other_focal_lengths() const {
  std::optional<Solved> best;
  double least = std::numeric_limits<double>::infinity();
  for (const double share : {0.65, 0.8, 1.0, 1.25, 1.6}) {
    Solved start{before_.values, {}};
    start.values[0] *= share;
    for (const View& view : views_) {
      View there = view;
      there.camera_from_body.translation.z() *= start.values[0] / estimate_.values[0];
      double noise = 1;
      start.poses.push_back(find_pose(start.values, there, &noise).value_or(there.camera_from_body));
    }
    const auto found = solve_views(std::move(start));
    if (!found) continue;
    // Costs are compared at the same noise.
    double cost = 0;
    for (std::size_t i = 0; i < views_.size(); ++i)
      cost += blocks(found->values, views_[i], found->poses[i], 1).cost;
    if (cost >= least) continue;
    least = cost;
    best = found;
  }
  return best;
}

void OnlineIntrinsics::adopt(const Solved& found) {
  Matrix5d all = inverse_of(before_.covariance);
  for (std::size_t i = 0; i < views_.size(); ++i) {
    views_[i].camera_from_body = found.poses[i];
    views_[i].information = blocks(found.values, views_[i], found.poses[i], found.noise).information();
    all += views_[i].information;
  }
  IntrinsicsEstimate estimate = estimate_;
  estimate.values = found.values;
  const Matrix5d covariance = inverse_of(all);
  estimate.covariance = 0.5 * (covariance + covariance.transpose());
  estimate.views = before_.views + static_cast<int>(views_.size());
  if (!estimate.is_sound()) return;
  estimate_ = estimate;
  noise_ = found.noise;
}

bool OnlineIntrinsics::contradicts_before() const {
  const Vector5d off = estimate_.values - before_.values;
  return before_.views > 0 && off.dot(inverse_of(before_.covariance) * off) > k_contradiction;
}

void OnlineIntrinsics::forget() {
  before_ = prior_intrinsics(before_.width, before_.height);
  estimate_ = before_;
  views_.clear();
  noise_ = 1;
  misfits_ = 0;
}

void OnlineIntrinsics::improve() {
  if (views_.empty()) return;
  const auto solve = [&] {
    const bool is_unsure = estimate_.focal_stddev_px() > k_unsure_share * estimate_.values[0];
    Solved start{estimate_.values, {}};
    for (const View& view : views_) start.poses.push_back(view.camera_from_body);
    if (const auto found = is_unsure ? solve_from_other_focal_lengths() : solve_views(std::move(start)))
      adopt(*found);
  };
  solve();
  if (!contradicts_before()) return;
  before_ = prior_intrinsics(before_.width, before_.height);
  estimate_.covariance = before_.covariance;
  solve();
}

}  // namespace limn::calib
