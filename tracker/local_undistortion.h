#pragma once

#include <Eigen/Core>
#include <array>

#include "core/lens.h"

namespace limn::tracker {

/// Turns a small part of a lens's image into one where straight lines are straight, as a pinhole camera sees
/// it. The part's middle keeps its place, size and shape. It is a polynomial of fourth order in the distance
/// from there.
class LocalUndistortion {
 public:
  /// The identity.
  LocalUndistortion() = default;

  /// A map for the surroundings of `middle_px`, as far as `radius_px`. It is the identity where the lens
  /// model has no directions.
  LocalUndistortion(const Lens& lens, const Eigen::Vector2d& middle_px, double radius_px);

  /// A map for a quadrilateral and `outside_px` around it; the identity when there is no lens.
  static LocalUndistortion about(const Lens* lens,
                                 const std::array<Eigen::Vector2d, 4>& corners_px,
                                 double outside_px);

  bool moves() const { return moves_; }

  /// The place in the undistorted part of a pixel of the lens.
  Eigen::Vector2d straight(const Eigen::Vector2d& px) const {
    return moves_ ? Eigen::Vector2d(px + bend(px)) : px;
  }

  /// The lens's pixel of a place in the undistorted part.
  Eigen::Vector2d bent(const Eigen::Vector2d& straight_px) const {
    return moves_ ? found_bent(straight_px) : straight_px;
  }

 private:
  static constexpr int k_terms = 15;
  using Terms = Eigen::Matrix<double, k_terms, 1>;
  bool moves_ = false;
  Eigen::Vector2d middle_px_ = Eigen::Vector2d::Zero();
  double radius_px_ = 1;
  Eigen::Matrix<double, 2, k_terms> bend_ = Eigen::Matrix<double, 2, k_terms>::Zero();  // pixels

  static Terms terms(const Eigen::Vector2d& place);
  Eigen::Vector2d found_bent(const Eigen::Vector2d& straight_px) const;
  Eigen::Vector2d bend(const Eigen::Vector2d& px) const {
    return bend_ * terms((px - middle_px_) / radius_px_);
  }
};

}  // namespace limn::tracker
