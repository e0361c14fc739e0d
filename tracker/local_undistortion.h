#pragma once

#include <Eigen/Core>
#include <array>

#include "core/lens.h"

namespace limn::tracker {

/// A part of a lens's image as a pinhole camera sees it in which straight things are straight, and which
/// shows the part's middle in the same place, size and shape. To the fourth order of the distance from there.
class LocalUndistortion {
 public:
  /// Nothing is moved.
  LocalUndistortion() = default;

  /// About `middle_px`, as far as `radius_px`; moves nothing where the lens's model has no directions.
  LocalUndistortion(const Lens& lens, const Eigen::Vector2d& middle_px, double radius_px);

  /// About a quadrilateral and as far as `outside_px` from it; with no lens nothing is moved.
  static LocalUndistortion about(const Lens* lens,
                                 const std::array<Eigen::Vector2d, 4>& corners_px,
                                 double outside_px);

  bool moves() const { return moves_; }

  /// Of the lens's pixel.
  Eigen::Vector2d straight(const Eigen::Vector2d& px) const {
    return moves_ ? Eigen::Vector2d(px + bend(px)) : px;
  }

  /// The lens's pixel of it.
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
