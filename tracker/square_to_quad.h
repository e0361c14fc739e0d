#pragma once

#include <Eigen/Core>
#include <array>

namespace limn::tracker {

/// The homography from the unit square, (0,0) (1,0) (1,1) (0,1), to four pixels (Heckbert 1989, "Fundamentals
/// of texture mapping and image warping").
class SquareToQuad {
 public:
  explicit SquareToQuad(const std::array<Eigen::Vector2d, 4>& q) {
    const Eigen::Vector2d sum = q[0] - q[1] + q[2] - q[3];
    const Eigen::Vector2d a = q[1] - q[2];
    const Eigen::Vector2d b = q[3] - q[2];
    const double determinant = a.x() * b.y() - b.x() * a.y();
    const double g = (sum.x() * b.y() - b.x() * sum.y()) / determinant;
    const double h = (a.x() * sum.y() - sum.x() * a.y()) / determinant;
    matrix_ << q[1].x() - q[0].x() + g * q[1].x(), q[3].x() - q[0].x() + h * q[3].x(), q[0].x(),
        q[1].y() - q[0].y() + g * q[1].y(), q[3].y() - q[0].y() + h * q[3].y(), q[0].y(), g, h, 1;
  }
  Eigen::Vector2d at(double x, double y) const {
    const Eigen::Vector3d p = matrix_ * Eigen::Vector3d(x, y, 1);
    return p.head<2>() / p.z();
  }
  const Eigen::Matrix3d& matrix() const { return matrix_; }

 private:
  Eigen::Matrix3d matrix_;
};

}  // namespace limn::tracker
