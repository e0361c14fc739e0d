#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "core/enum_names.h"
#include "core/result.h"

namespace limn::exchange {

/// A curve in space, by points along it in the frame of its file, m.
struct NamedCurve {
  std::string name = {};                     ///< UTF-8.
  std::vector<Eigen::Vector3d> points = {};  ///< At least two; no two neighbours are equal.
  bool is_closed = false;  ///< The last point is joined to the first, which is not repeated.
};

/// What a curve is between its points.
enum class CurveForm {
  polyline,  ///< Straight: comes in again with the same points.
  spline     ///< A cubic B-spline through the points, which engineers can edit; for dense points.
};
inline constexpr EnumNames<CurveForm, 2> k_curve_form{{"polyline", "spline"}};

/// Error: fewer than two points (three for a closed curve), a point that is not finite or that equals its
/// neighbour. The message begins with `where` and the curve's name.
Status check_curve(const NamedCurve& curve, const std::string& where);

}  // namespace limn::exchange
