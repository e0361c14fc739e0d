#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <span>
#include <vector>

#include "core/imager.h"

namespace limn::sim {

/// World directions for any sub-pixel position of an imager, up to one pixel beyond its border. They are
/// exact on a grid and interpolated by cubics (Catmull-Rom) in between; the error is below 1e-8 rad.
class Directions {
 public:
  explicit Directions(const Imager& imager);

  /// Unit direction; NaN where the lens has none.
  Eigen::Vector3f at(double x, double y) const;
  /// Directions of pixels (x0, y), (x0 + 1, y), …
  void row(double x0, double y, std::span<Eigen::Vector3f> d) const;

 private:
  std::size_t index(int r, int c) const {
    return static_cast<std::size_t>(r) * static_cast<std::size_t>(columns_) + static_cast<std::size_t>(c);
  }
  int columns_, rows_;
  std::vector<Eigen::Vector3d> knots_;
};

}  // namespace limn::sim
