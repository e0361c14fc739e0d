#include "tracker/local_undistortion.h"

#include <Eigen/Dense>
#include <algorithm>

namespace limn::tracker {

LocalUndistortion::Terms LocalUndistortion::terms(const Eigen::Vector2d& place) {
  const double x = place.x();
  const double y = place.y();
  Terms terms;
  const double xx = x * x;
  const double xy = x * y;
  const double yy = y * y;
  terms << 1, x, y, xx, xy, yy, xx * x, xx * y, x * yy, yy * y, xx * xx, xx * xy, xx * yy, xy * yy, yy * yy;
  return terms;
}

LocalUndistortion::LocalUndistortion(const Lens& lens, const Eigen::Vector2d& middle_px, double radius_px)
    : middle_px_(middle_px), radius_px_(radius_px) {
  constexpr int k_side = 5;
  const auto d_middle = lens.unproject(middle_px);
  if (!d_middle) return;
  const Eigen::Quaterniond ahead = Eigen::Quaterniond::FromTwoVectors(*d_middle, Eigen::Vector3d::UnitZ());
  Eigen::Matrix<double, k_side * k_side, k_terms> places;
  Eigen::Matrix<double, k_side * k_side, 2> seen;  // in the plane z = 1, whose axis is the middle's direction
  for (int i = 0; i < k_side * k_side; ++i) {
    const Eigen::Vector2d place(2.0 * (i % k_side) / (k_side - 1) - 1, 2.0 * (i / k_side) / (k_side - 1) - 1);
    const auto d = lens.unproject(middle_px + radius_px * place);
    if (!d) return;
    const Eigen::Vector3d p = ahead * *d;
    if (!(p.z() > 0)) return;
    places.row(i) = terms(place).transpose();
    seen.row(i) = (p.head<2>() / p.z()).transpose();
  }
  const Eigen::Matrix<double, k_terms, k_terms> normal = places.transpose() * places;
  const Eigen::Matrix<double, 2, k_terms> fitted = normal.ldlt().solve(places.transpose() * seen).transpose();
  const Eigen::Matrix2d px_from_plane = radius_px * fitted.middleCols<2>(1).inverse();
  bend_ = px_from_plane * fitted;
  bend_.leftCols<3>().setZero();
  moves_ = bend_.allFinite();
}

LocalUndistortion LocalUndistortion::about(const Lens* lens,
                                           const std::array<Eigen::Vector2d, 4>& corners_px,
                                           double outside_px) {
  if (!lens) return {};
  const Eigen::Vector2d middle = 0.25 * (corners_px[0] + corners_px[1] + corners_px[2] + corners_px[3]);
  double radius = 0;
  for (const Eigen::Vector2d& corner : corners_px)
    radius = std::max(radius, (corner - middle).lpNorm<Eigen::Infinity>());
  return {*lens, middle, radius + outside_px};
}

Eigen::Vector2d LocalUndistortion::found_bent(const Eigen::Vector2d& straight_px) const {
  constexpr int k_rounds = 6;  // each leaves a tenth of the error or less
  constexpr double k_settled_px = 1e-6;
  Eigen::Vector2d px = straight_px;
  for (int round = 0; round < k_rounds; ++round) {
    const Eigen::Vector2d before = px;
    px = straight_px - bend(px);
    if ((px - before).lpNorm<Eigen::Infinity>() < k_settled_px) break;
  }
  return px;
}

}  // namespace limn::tracker
