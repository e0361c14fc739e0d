#include "tracker/marker_pose.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <optional>

#include "core/linear_algebra.h"
#include "tracker/pose_fit.h"
#include "tracker/square_to_quad.h"

namespace limn::tracker {
namespace {

// Minima nearer than this (rad) are the same: refinement stops far below it.
constexpr double k_same_angle = 1e-4;

std::optional<std::array<Eigen::Vector2d, 4>> undistorted(const Lens& lens,
                                                          const std::array<Eigen::Vector2d, 4>& corners_px) {
  std::array<Eigen::Vector2d, 4> points;
  for (std::size_t i = 0; i < 4; ++i) {
    const auto d = corners_px[i].allFinite() ? lens.unproject(corners_px[i]) : std::nullopt;
    if (!d || !(d->z() > 1e-6)) return std::nullopt;
    points[i] = d->head<2>() / d->z();
  }
  return points;
}

// The translation that brings the rotated corners nearest to the rays (linear least squares of x - z u = 0).
Eigen::Vector3d best_translation(const Eigen::Matrix3d& rotation,
                                 const std::array<Eigen::Vector3d, 4>& corners,
                                 const std::array<Eigen::Vector2d, 4>& points) {
  Eigen::Matrix<double, 8, 3> a;
  Eigen::Matrix<double, 8, 1> b;
  for (int i = 0; i < 4; ++i) {
    const Eigen::Vector3d p = rotation * corners[static_cast<std::size_t>(i)];
    const Eigen::Vector2d& u = points[static_cast<std::size_t>(i)];
    a.row(2 * i) << 1, 0, -u.x();
    a.row(2 * i + 1) << 0, 1, -u.y();
    b[2 * i] = p.z() * u.x() - p.x();
    b[2 * i + 1] = p.z() * u.y() - p.y();
  }
  return a.colPivHouseholderQr().solve(b);
}

// Whether the corners run clockwise as seen (y down), so that the marker's face is visible and not its back.
bool is_clockwise(const std::array<Eigen::Vector2d, 4>& c) {
  for (std::size_t i = 0; i < 4; ++i) {
    const Eigen::Vector2d a = c[(i + 1) % 4] - c[i];
    const Eigen::Vector2d b = c[(i + 2) % 4] - c[(i + 1) % 4];
    if (!(a.x() * b.y() - a.y() * b.x() > 1e-14)) return false;
  }
  return true;
}

std::optional<std::array<PointObservation, 4>> corner_observations(
    const Lens& lens,
    const std::array<Eigen::Vector3d, 4>& corners,
    const std::array<Eigen::Vector2d, 4>& corners_px,
    const std::array<Eigen::Matrix2d, 4>& covariance) {
  std::array<PointObservation, 4> observations;
  for (std::size_t i = 0; i < 4; ++i) {
    const Eigen::Matrix2d information = covariance[i].inverse();
    if (!information.allFinite() || !(information.determinant() > 0)) return std::nullopt;
    observations[i] = {&lens, Pose{}, corners[i], corners_px[i], information};
  }
  return observations;
}

// Sets the weights, which add up to 1, and sorts likeliest first.
void weigh(std::vector<MarkerPose>* poses, const std::vector<double>& chi_squares) {
  const double least = *std::min_element(chi_squares.begin(), chi_squares.end());
  double sum = 0;
  for (std::size_t i = 0; i < poses->size(); ++i)
    sum += (*poses)[i].weight = std::exp(-0.5 * (chi_squares[i] - least));
  for (MarkerPose& pose : *poses) pose.weight /= sum;
  std::stable_sort(poses->begin(), poses->end(),
                   [](const auto& a, const auto& b) { return a.weight > b.weight; });
}

}  // namespace

std::array<Eigen::Vector3d, 4> square_corners(double size_m) {
  const double h = 0.5 * size_m;
  return {Eigen::Vector3d(-h, -h, 0), Eigen::Vector3d(h, -h, 0), Eigen::Vector3d(h, h, 0),
          Eigen::Vector3d(-h, h, 0)};
}

Eigen::Matrix3d homography_from_square(const std::array<Eigen::Vector2d, 4>& points) {
  const Eigen::Matrix3d unit_from_square =
      (Eigen::Matrix3d() << 0.5, 0, 0.5, 0, 0.5, 0.5, 0, 0, 1).finished();  // the corners are at -1 and 1
  const Eigen::Matrix3d homography = SquareToQuad(points).matrix() * unit_from_square;
  if (!homography.allFinite() || homography(2, 2) == 0) return Eigen::Matrix3d::Zero();
  return homography / homography(2, 2);
}

std::vector<Eigen::Matrix3d> planar_rotations(const Eigen::Matrix3d& h) {
  // Value v and derivative J of the homography at the plane's origin.
  const Eigen::Vector2d v = h.col(2).head<2>() / h(2, 2);
  Eigen::Matrix2d j = h.topLeftCorner<2, 2>() / h(2, 2);
  j -= v * h.row(2).head<2>() / h(2, 2);
  // This rotation takes the optical axis to the ray through the origin's image.
  const Eigen::Vector3d d = Eigen::Vector3d(v.x(), v.y(), 1).normalized();
  const Eigen::Matrix3d ray_turn = rotation_between(Eigen::Vector3d::UnitZ(), d).toRotationMatrix();
  Eigen::Matrix<double, 2, 3> projection;
  projection << 1, 0, -v.x(), 0, 1, -v.y();
  const Eigen::Matrix2d b = (projection * ray_turn).leftCols<2>();
  const Eigen::Matrix2d a = b.inverse() * j;
  const Eigen::JacobiSVD<Eigen::Matrix2d> svd(a);
  const double gamma = svd.singularValues()[0];
  if (!(gamma > 1e-12) || !a.allFinite()) return {};
  // a / gamma is the upper left block of the rotation. The rest follows from it except for one sign.
  const Eigen::Matrix2d block = a / gamma;
  const Eigen::Matrix2d rest = Eigen::Matrix2d::Identity() - block.transpose() * block;
  const double b1 = std::sqrt(std::max(0.0, rest(0, 0)));
  const double b2 = std::copysign(std::sqrt(std::max(0.0, rest(1, 1))), rest(0, 1));
  std::vector<Eigen::Matrix3d> rotations;
  for (const double sign : {1.0, -1.0}) {
    Eigen::Vector3d x(block(0, 0), block(1, 0), sign * b1);
    Eigen::Vector3d y(block(0, 1), block(1, 1), sign * b2);
    x.normalize();
    y = (y - x * x.dot(y)).normalized();
    Eigen::Matrix3d rotation;
    rotation << x, y, x.cross(y);
    if (rotation.allFinite()) rotations.push_back(ray_turn * rotation);
  }
  return rotations;
}

std::vector<MarkerPose> marker_poses(const Lens& lens,
                                     double size_m,
                                     const std::array<Eigen::Vector2d, 4>& corners_px,
                                     const std::array<Eigen::Matrix2d, 4>& corner_covariance) {
  if (!(size_m > 0) || !std::isfinite(size_m)) return {};
  const auto points = undistorted(lens, corners_px);
  if (!points || !is_clockwise(*points)) return {};
  const Eigen::Matrix3d homography = homography_from_square(*points);
  if (homography.isZero(0)) return {};
  const auto corners = square_corners(size_m);
  const auto observations = corner_observations(lens, corners, corners_px, corner_covariance);
  if (!observations) return {};
  std::vector<MarkerPose> poses;
  std::vector<double> chi_squares;
  for (const Eigen::Matrix3d& rotation : planar_rotations(homography)) {
    const Eigen::Vector3d translation = best_translation(rotation, corners, *points);
    const auto fit = fit_pose(*observations, Pose(rotation, translation));
    if (!fit) continue;
    const bool known = std::any_of(poses.begin(), poses.end(), [&](const MarkerPose& other) {
      return angle_between(other.camera_from_marker.rotation, fit->world_from_body.rotation) < k_same_angle;
    });
    if (known) continue;
    poses.push_back({fit->world_from_body, fit->rms_px, fit->covariance, 1});
    chi_squares.push_back(fit->chi_square);
  }
  if (!poses.empty()) weigh(&poses, chi_squares);
  return poses;
}

}  // namespace limn::tracker
