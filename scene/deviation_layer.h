#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "core/result.h"

namespace limn::scene {

/// The prototype's deviation from its CAD, as light shows it: values on a grid over each triangle of the
/// prototype's mesh, so that they can be interpolated exactly where a ray meets it. A result never changes.
struct DeviationLayer {
  /// A triangle whose sides are divided into `divisions` equal pieces. Its points (i, j), i + j <= divisions,
  /// lie i pieces from its first corner towards its second, and j towards its third. They are at first + j *
  /// (divisions + 1) - j * (j - 1) / 2 + i.
  struct Triangle {
    std::uint32_t first = 0;
    std::uint32_t divisions = 1;
  };
  /// A place where the deviation is largest.
  struct Mark {
    Eigen::Vector3d p_prototype = Eigen::Vector3d::Zero();
    Eigen::Vector3d d_normal = Eigen::Vector3d::UnitZ();
    double distance_m = 0;
  };

  int number = 0;                                 ///< Counts a session's results from 1.
  std::vector<Triangle> triangles;                ///< As in the mesh.
  std::vector<std::uint32_t> values;              ///< deviation_value() of each point.
  std::array<Eigen::Vector3f, 7> band_colours{};  ///< Linear light, from the shyest band to the proudest.
  std::vector<Mark> marks;                        ///< The largest deviations, the largest first.
  std::vector<std::string> unsure;                ///< Directions that the shape did not determine.
};

/// The value of a point where nothing was measured.
inline constexpr std::uint32_t k_no_deviation = 0xffff0000;

/// A deviation and its standard deviation in a word, each in micrometres: the former signed in the lower half
/// (at most 32 mm), the latter in the upper half (at most 65 mm).
std::uint32_t deviation_value(double distance_m, double stddev_m);

/// The number of points of a triangle.
constexpr std::size_t points_of_divisions(std::size_t divisions) {
  return (divisions + 1) * (divisions + 2) / 2;
}

/// The layer as bytes, for files and messages; deviation_layer_of() reads them. Error: damaged bytes, or
/// triangles and points that do not fit each other.
std::string bytes_of(const DeviationLayer& layer);
Result<DeviationLayer> deviation_layer_of(std::string_view bytes);

}  // namespace limn::scene
