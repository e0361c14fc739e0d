#include "core/lens.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "core/mrcal.h"
#include "core/parallel.h"

namespace limn {

struct LensModel::Impl {
  std::string name;
  const MrcalFunctions* mrcal = nullptr;
  mrcal_lensmodel_t model{};
  int value_count = 0;
  bool projects_behind = false;

  bool may_show(const Eigen::Vector3d& p) const {
    return p.allFinite() && !p.isZero(0) && (projects_behind || p.z() > 0);
  }

  // Derivatives by the values are possible for one point only: mrcal 2.2 confuses the derivatives of several
  // points in one call, and in mrcal_project_pinhole also their pixels.
  bool project(std::span<const double> values,
               std::span<const Eigen::Vector3d> p,
               Eigen::Vector2d* px,
               PixelByPoint* d_px_d_p,
               double* d_px_d_values) const {
    static_assert(sizeof(Eigen::Vector3d) == sizeof(mrcal_point3_t) &&
                  sizeof(Eigen::Vector2d) == sizeof(mrcal_point2_t) &&
                  sizeof(PixelByPoint) == 2 * sizeof(mrcal_point3_t));
    const auto* points = reinterpret_cast<const mrcal_point3_t*>(p.data());
    auto* pixels = reinterpret_cast<mrcal_point2_t*>(px);
    auto* gradients = reinterpret_cast<mrcal_point3_t*>(d_px_d_p);
    const int count = static_cast<int>(p.size());
    if (!gradients || d_px_d_values)
      return mrcal->project(pixels, gradients, d_px_d_values, points, count, &model, values.data());
    for (int i = 0; i < count; ++i) {
      if (model.type == MRCAL_LENSMODEL_PINHOLE)
        mrcal->project_pinhole(pixels + i, gradients + 2 * i, points + i, 1, values.data());
      else if (!mrcal->project(pixels + i, gradients + 2 * i, nullptr, points + i, 1, &model, values.data()))
        return false;
    }
    return true;
  }
};

namespace {

// Beyond this tangent of the off-axis angle (35°) a polynomial distortion can fold back on itself. Below it
// the distortion of no real lens does.
constexpr double k_surely_unfolded_tangent = 0.7;
constexpr double k_fold_step = 1.15;  // ratio of successive tangents that are checked from there outwards
constexpr int k_max_newton_steps = 30;
constexpr double k_unproject_tolerance_px = 1e-9;
constexpr double k_accepted_residual_px = 1e-6;

// Whether mrcal can use a splined lens's grid safely. mrcal accepts any grid: the number of values can
// overflow, and with fewer columns or rows than a spline needs it reads out of bounds.
bool has_sound_grid(const mrcal_lensmodel_t& model) {
  if (model.type != MRCAL_LENSMODEL_SPLINED_STEREOGRAPHIC) return true;
  constexpr int k_most = 1000;
  const auto& grid = model.LENSMODEL_SPLINED_STEREOGRAPHIC__config;
  const auto is_sound = [&](int count) { return count > grid.order && count <= k_most; };
  return (grid.order == 2 || grid.order == 3) && is_sound(grid.Nx) && is_sound(grid.Ny) &&
         grid.fov_x_deg > 0 && grid.fov_x_deg < 360;
}

// Determinant of d(px)/d(x, y) at (x, y, 1): positive where the lens keeps the image's orientation.
bool keeps_orientation(const LensModel& model, std::span<const double> values, const Eigen::Vector2d& xy) {
  Eigen::Vector2d px;
  PixelByPoint jacobian;
  if (!model.project(values, xy.homogeneous(), &px, jacobian.data())) return false;
  return jacobian.leftCols<2>().determinant() > 0;
}

// Whether the lens maps the whole segment from the axis to (x, y, 1) without folding.
bool is_unfolded(const LensModel& model, std::span<const double> values, const Eigen::Vector2d& xy) {
  const double tangent = xy.norm();
  if (!(tangent > k_surely_unfolded_tangent)) return true;
  for (double r = k_surely_unfolded_tangent; r < tangent; r *= k_fold_step) {
    if (!keeps_orientation(model, values, xy * (r / tangent))) return false;
  }
  return keeps_orientation(model, values, xy);
}

// Two coordinates for a direction: (x, y, 1) for models with a projection plane, else stereographic ones,
// which also reach behind the imager.
Eigen::Vector3d point_at(const LensModel& model, const Eigen::Vector2d& xy) {
  return {xy.x(), xy.y(), model.projects_behind() ? 1 - xy.squaredNorm() / 4 : 1};
}

// Derivative of the pixel with respect to these coordinates.
Eigen::Matrix2d by_coordinates(const LensModel& model,
                               const PixelByPoint& d_px_d_p,
                               const Eigen::Vector2d& xy) {
  if (!model.projects_behind()) return d_px_d_p.leftCols<2>();
  return d_px_d_p.leftCols<2>() - d_px_d_p.col(2) * xy.transpose() / 2;
}

// Newton's method on these coordinates; steps are halved while the residual grows.
bool newton_unproject(const LensModel& model,
                      std::span<const double> values,
                      const Eigen::Vector2d& px,
                      Eigen::Vector2d xy,
                      Eigen::Vector3d* d_imager) {
  Eigen::Vector2d found;
  PixelByPoint jacobian;
  if (!model.project(values, point_at(model, xy), &found, jacobian.data())) return false;
  double residual = (found - px).norm();
  for (int step = 0; step < k_max_newton_steps && residual > k_unproject_tolerance_px; ++step) {
    const Eigen::Vector2d delta = by_coordinates(model, jacobian, xy).inverse() * (px - found);
    double scale = 1;
    Eigen::Vector2d tried;
    for (;; scale /= 2) {
      if (scale < 1e-3 || !delta.allFinite()) return false;
      tried = xy + scale * delta;
      if (model.project(values, point_at(model, tried), &found, jacobian.data()) &&
          (found - px).norm() < residual) {
        break;
      }
      if (residual < k_accepted_residual_px) {  // limit of rounding: no step improves it further
        *d_imager = point_at(model, xy).normalized();
        return true;
      }
    }
    xy = tried;
    residual = (found - px).norm();
  }
  if (!(residual < k_accepted_residual_px)) return false;
  *d_imager = point_at(model, xy).normalized();
  return true;
}

}  // namespace

LensModel::LensModel() : LensModel(parse("LENSMODEL_PINHOLE").value()) {}

Result<LensModel> LensModel::parse(const std::string& name) {
  auto impl = std::make_shared<Impl>();
  impl->name = name;
  const Error unknown = error(
      "lens model '{}': expected one of mrcal's models, such as LENSMODEL_PINHOLE, LENSMODEL_OPENCV4, "
      "LENSMODEL_OPENCV5, LENSMODEL_OPENCV8, LENSMODEL_OPENCV12 or "
      "LENSMODEL_SPLINED_STEREOGRAPHIC_order=3_Nx=30_Ny=18_fov_x_deg=100.",
      name);
  LIMN_TRY(const MrcalFunctions* mrcal, mrcal_functions());
  if (!mrcal_lensmodel_type_is_valid(mrcal->lensmodel_type_from_name(name.c_str()))) return unknown;
  if (!mrcal->lensmodel_from_name(&impl->model, name.c_str()) || !has_sound_grid(impl->model)) return unknown;
  impl->mrcal = mrcal;
  const mrcal_lensmodel_metadata_t metadata = mrcal->lensmodel_metadata(&impl->model);
  if (!metadata.has_core || !metadata.has_gradients) return unknown;
  impl->projects_behind = metadata.can_project_behind_camera;
  impl->value_count = mrcal->lensmodel_num_params(&impl->model);
  return LensModel(std::move(impl));
}

const std::string& LensModel::name() const { return impl_->name; }
int LensModel::value_count() const { return impl_->value_count; }
bool LensModel::projects_behind() const { return impl_->projects_behind; }

bool LensModel::project(std::span<const double> values,
                        const Eigen::Vector3d& p,
                        Eigen::Vector2d* px,
                        double* d_px_d_p,
                        double* d_px_d_values) const {
  LIMN_CHECK(static_cast<int>(values.size()) == impl_->value_count);
  if (!impl_->may_show(p)) return false;
  PixelByPoint gradient;
  if (!impl_->project(values, std::span(&p, 1), px, d_px_d_p ? &gradient : nullptr, d_px_d_values))
    return false;
  if (d_px_d_p) std::copy_n(gradient.data(), gradient.size(), d_px_d_p);
  return px->allFinite();
}

bool LensModel::project_all(std::span<const double> values,
                            std::span<const Eigen::Vector3d> p,
                            std::span<Eigen::Vector2d> px,
                            std::span<PixelByPoint> d_px_d_p) const {
  LIMN_CHECK(static_cast<int>(values.size()) == impl_->value_count);
  LIMN_CHECK(px.size() == p.size() && (d_px_d_p.empty() || d_px_d_p.size() == p.size()));
  const auto is_finite = [](const Eigen::Vector2d& pixel) { return pixel.allFinite(); };
  return std::ranges::all_of(p, [&](const Eigen::Vector3d& point) { return impl_->may_show(point); }) &&
         impl_->project(values, p, px.data(), d_px_d_p.empty() ? nullptr : d_px_d_p.data(), nullptr) &&
         std::ranges::all_of(px, is_finite);
}

bool LensModel::unproject(std::span<const double> values,
                          const Eigen::Vector2d& px,
                          Eigen::Vector3d* d_imager) const {
  if (!px.allFinite()) return false;
  const Eigen::Vector2d start((px.x() - values[2]) / values[0], (px.y() - values[3]) / values[1]);
  if (!impl_->projects_behind) {
    return newton_unproject(*this, values, px, start, d_imager) &&
           is_unfolded(*this, values, d_imager->hnormalized());
  }
  if (newton_unproject(*this, values, px, start, d_imager)) return true;
  // mrcal's own search is many times slower, but finds directions far from the start.
  const mrcal_point2_t pixel{.xy = {px.x(), px.y()}};
  mrcal_point3_t direction{};
  if (!impl_->mrcal->unproject(&direction, &pixel, 1, &impl_->model, values.data())) return false;
  *d_imager = Eigen::Vector3d(direction.x, direction.y, direction.z).normalized();
  return d_imager->allFinite();
}

Result<Lens> Lens::create(const std::string& model_name, std::vector<double> values) {
  LIMN_TRY(LensModel model, LensModel::parse(model_name));
  if (static_cast<int>(values.size()) != model.value_count()) {
    return error("lens values: expected {} numbers for {}, found {}.", model.value_count(), model_name,
                 values.size());
  }
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!std::isfinite(values[i]))
      return error("lens values[{}]: expected a finite number, found {}.", i, values[i]);
  }
  if (!(values[0] > 0 && values[1] > 0)) {
    return error("lens values: expected focal lengths fx, fy in pixels (> 0), found {} and {}.", values[0],
                 values[1]);
  }
  for (std::size_t i = 0; i < 4; ++i) {
    if (std::abs(values[i]) > k_largest_lens_px)
      return error("lens values[{}]: expected a number of pixels up to {:g}, found {:g}.", i,
                   k_largest_lens_px, values[i]);
  }
  return Lens{std::move(model), std::move(values)};
}

Lens Lens::pinhole(double fx, double fy, double cx, double cy) { return {LensModel(), {fx, fy, cx, cy}}; }

std::optional<Eigen::Vector2d> Lens::project(const Eigen::Vector3d& p) const {
  Eigen::Vector2d px;
  if (!model.project(values, p, &px)) return std::nullopt;
  if (!model.projects_behind() && !is_unfolded(model, values, p.hnormalized())) return std::nullopt;
  return px;
}

std::optional<Eigen::Vector3d> Lens::unproject(const Eigen::Vector2d& px) const {
  Eigen::Vector3d d_imager;
  if (!model.unproject(values, px, &d_imager)) return std::nullopt;
  return d_imager;
}

std::vector<Eigen::Vector3f> direction_map(const Lens& lens, int width, int height, int step) {
  const int columns = (width + step - 1) / step;
  const int rows = (height + step - 1) / step;
  std::vector<Eigen::Vector3f> directions(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows));
  parallel_for(rows, [&](int row) {
    const float nan = std::numeric_limits<float>::quiet_NaN();
    for (int column = 0; column < columns; ++column) {
      const auto d = lens.unproject(Eigen::Vector2d(column, row) * step);
      directions[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns) +
                 static_cast<std::size_t>(column)] =
          d ? Eigen::Vector3f(d->cast<float>()) : Eigen::Vector3f(nan, nan, nan);
    }
  });
  return directions;
}

}  // namespace limn
