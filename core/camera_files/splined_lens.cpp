#include "core/camera_files/splined_lens.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "core/mrcal.h"

namespace limn {
namespace {

using Eigen::Vector2d;

constexpr double k_degree = std::numbers::pi / 180;
constexpr double k_widest_angle = 120 * k_degree;  // off the axis; no lens sees further back
constexpr double k_searched_angle = 150 * k_degree;

// mrcal's stereographic coordinates: u = 2 tan(angle / 2) in the direction of the pixel.
Eigen::Vector3d direction_of(const Vector2d& u) {
  const double tangent_squared = u.squaredNorm() / 4;
  return {u.x(), u.y(), 1 - tangent_squared};  // its length is 1 + tangent_squared
}

double stereographic_radius(double angle) { return 2 * std::tan(angle / 2); }

// The part of the coordinates u whose pixels lie in the area.
struct Reach {
  double radius = 0;                 // largest |u|
  Vector2d half = Vector2d::Zero();  // largest |u.x| and |u.y|
  double end = 0;                    // beyond this |u| the formula is continued as a straight line
};

// Follows rays from the axis outwards, until their pixels come back (the formula folds).
Reach reach_of(const Projection& exact, const PixelArea& area) {
  constexpr int k_rays = 180;
  constexpr double k_step = 0.5 * k_degree;
  const auto centre = exact(Eigen::Vector3d::UnitZ());
  Reach reach;
  double fold = stereographic_radius(k_searched_angle);
  for (int ray = 0; ray < k_rays && centre; ++ray) {
    const double azimuth = 2 * std::numbers::pi * ray / k_rays;
    const Vector2d outwards(std::cos(azimuth), std::sin(azimuth));
    double previous = 0;
    bool is_inside = true;
    for (double angle = k_step; angle < k_searched_angle; angle += k_step) {
      const double radius = stereographic_radius(angle);
      const auto px = exact(direction_of(radius * outwards));
      const double distance = px ? (*px - *centre).norm() : 0;
      if (!(distance > previous)) {
        fold = std::min(fold, stereographic_radius(angle - k_step));
        break;
      }
      previous = distance;
      if (is_inside && angle <= k_widest_angle) {
        reach.radius = std::max(reach.radius, radius);
        reach.half = reach.half.cwiseMax((radius * outwards).cwiseAbs());
      }
      is_inside = is_inside && area.contains(*px);
    }
  }
  constexpr double k_before_fold = 0.95;  // there the pixels have all but reached the edge
  constexpr double k_beyond_area = 1.25;  // farther out a formula can have poles
  reach.radius = std::min(reach.radius, k_before_fold * fold);
  reach.half = reach.half.cwiseMin(reach.radius);
  reach.end = std::min(fold, k_beyond_area * reach.radius);
  return reach;
}

// What a splined lens adds to u: (pixel - c) / f - u. Outside the reach it goes on in a straight line.
Vector2d added_to(const Vector2d& u, const Projection& exact, const Lens& pinhole, double most_radius) {
  const auto added = [&](const Vector2d& at) -> Vector2d {
    const auto px = exact(direction_of(at));
    if (!px) return Vector2d::Zero();
    return Vector2d((px->x() - pinhole.cx()) / pinhole.fx(), (px->y() - pinhole.cy()) / pinhole.fy()) - at;
  };
  const double radius = u.norm();
  if (radius <= most_radius) return added(u);
  constexpr double k_inwards = 1e-4;
  const Vector2d edge = u * (most_radius / radius);
  const Vector2d slope = (added(edge) - added(edge * (1 - k_inwards))) / (k_inwards * most_radius);
  return added(edge) + (radius - most_radius) * slope;
}

// The matrix that takes the values of a cubic B-spline at its knots to its control points. At both ends the
// second difference of the control points is zero, and the value there is not used.
Eigen::MatrixXd control_from_values(int count) {
  Eigen::MatrixXd values = Eigen::MatrixXd::Zero(count, count);
  for (int i = 1; i + 1 < count; ++i) values.row(i).segment<3>(i - 1) << 1 / 6.0, 4 / 6.0, 1 / 6.0;
  values.row(0).head<3>() << 1, -2, 1;
  values.row(count - 1).tail<3>() << 1, -2, 1;
  Eigen::MatrixXd control = values.inverse();
  control.col(0).setZero();
  control.col(count - 1).setZero();
  return control;
}

struct Knots {
  std::string model_name;
  std::vector<double> x, y;
};

// A grid of `columns` knots that goes beyond the reach by some cells, where the ends have no influence.
std::optional<Knots> knots_over(const Reach& reach, int columns) {
  constexpr int k_cells_outside = 5;
  const double edge = reach.half.x() * columns / (columns - 2 * k_cells_outside);
  const int fov_deg = static_cast<int>(std::ceil(4 * std::atan(edge / 2) / k_degree));
  const double cell = 2 * stereographic_radius(fov_deg * k_degree / 2) / columns;
  const int rows = 2 * (static_cast<int>(std::ceil(reach.half.y() / cell)) + k_cells_outside) + 1;
  Knots knots{
      fmt::format("LENSMODEL_SPLINED_STEREOGRAPHIC_order=3_Nx={}_Ny={}_fov_x_deg={}", columns, rows, fov_deg),
      std::vector<double>(static_cast<std::size_t>(columns)),
      std::vector<double>(static_cast<std::size_t>(rows))};
  const MrcalFunctions& mrcal = *mrcal_functions().value();  // the lens to be fitted has loaded them
  mrcal_lensmodel_t model;
  if (!mrcal.lensmodel_from_name(&model, knots.model_name.c_str()) ||
      !mrcal.knots_for_splined_models(knots.x.data(), knots.y.data(), &model))
    return std::nullopt;
  return knots;
}

Result<Lens> interpolated_lens(const Projection& exact,
                               const Lens& pinhole,
                               const Reach& reach,
                               const Knots& knots) {
  const auto columns = static_cast<Eigen::Index>(knots.x.size()),
             rows = static_cast<Eigen::Index>(knots.y.size());
  Eigen::MatrixXd added_x(rows, columns), added_y(rows, columns);
  for (Eigen::Index row = 0; row < rows; ++row) {
    for (Eigen::Index column = 0; column < columns; ++column) {
      const Vector2d u(knots.x[static_cast<std::size_t>(column)], knots.y[static_cast<std::size_t>(row)]);
      const Vector2d added = added_to(u, exact, pinhole, reach.end);
      added_x(row, column) = added.x();
      added_y(row, column) = added.y();
    }
  }
  const Eigen::MatrixXd by_row = control_from_values(static_cast<int>(rows));
  const Eigen::MatrixXd by_column = control_from_values(static_cast<int>(columns)).transpose();
  const Eigen::MatrixXd control_x = by_row * added_x * by_column, control_y = by_row * added_y * by_column;
  std::vector<double> values = {pinhole.fx(), pinhole.fy(), pinhole.cx(), pinhole.cy()};
  for (Eigen::Index row = 0; row < rows; ++row)
    for (Eigen::Index column = 0; column < columns; ++column)
      values.insert(values.end(), {control_x(row, column), control_y(row, column)});
  return Lens::create(knots.model_name, std::move(values));
}

// Largest distance of both formulas' pixels over a fine grid of directions in the area.
double worst_distance(const Projection& exact, const Lens& lens, const Reach& reach, const PixelArea& area) {
  constexpr int k_samples = 151;  // a side; not a multiple of the knots' number
  double worst = 0;
  for (int row = 0; row < k_samples; ++row) {
    for (int column = 0; column < k_samples; ++column) {
      const Vector2d share(2.0 * column / (k_samples - 1) - 1, 2.0 * row / (k_samples - 1) - 1);
      const Vector2d u = share.cwiseProduct(reach.half);
      if (u.norm() > reach.radius) continue;
      const auto wanted = exact(direction_of(u));
      if (!wanted || !area.contains(*wanted)) continue;
      const auto px = lens.project(direction_of(u));
      worst = std::max(worst, px ? (*px - *wanted).norm() : INFINITY);
    }
  }
  return worst;
}

}  // namespace

PixelArea area_of_image(int width, int height) { return {{-0.5, -0.5}, {width - 0.5, height - 0.5}}; }

Result<ConvertedLens> splined_lens(const Projection& exact, const Lens& pinhole, const PixelArea& area) {
  const Reach reach = reach_of(exact, area);
  double least_worst_px = INFINITY;
  for (const int columns : {31, 41, 61, 99}) {
    const auto knots = knots_over(reach, columns);
    if (!knots || knots->y.size() > 100) continue;
    auto lens = interpolated_lens(exact, pinhole, reach, *knots);
    if (!lens) continue;
    const double worst_px = worst_distance(exact, *lens, reach, area);
    if (worst_px <= k_most_conversion_px / 4) return ConvertedLens{*std::move(lens), worst_px};
    if (columns == 99 && worst_px <= k_most_conversion_px) return ConvertedLens{*std::move(lens), worst_px};
    least_worst_px = std::min(least_worst_px, worst_px);
  }
  return error(
      "expected a lens that mrcal's splined model holds within {} px, found one that it misses by {:.3f} px.",
      k_most_conversion_px, least_worst_px);
}

}  // namespace limn
