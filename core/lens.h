#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/result.h"

namespace limn {

/// Derivative of a pixel with respect to the point that it shows.
using PixelByPoint = Eigen::Matrix<double, 2, 3, Eigen::RowMajor>;

/// One of mrcal's lens models, without its values: `LENSMODEL_PINHOLE`, `LENSMODEL_OPENCV4/5/8/12`,
/// `LENSMODEL_SPLINED_STEREOGRAPHIC_order=…`, and so on. All formulas come from mrcal (mrcal.h).
/// An object is cheap to copy and can be used by several threads at once.
class LensModel {
 public:
  /// `LENSMODEL_PINHOLE`.
  LensModel();
  static Result<LensModel> parse(const std::string& name);

  const std::string& name() const;
  /// Number of values of a lens of this model; the first four are fx, fy, cx, cy (pixels).
  int value_count() const;
  /// Whether points behind the imager can have a pixel (splined and fisheye models).
  bool projects_behind() const;

  /// Pixel of p (imager frame, any unit, |p| > 0), for solvers that store the values themselves. `d_px_d_p`
  /// (2x3) and `d_px_d_values` (2 x value_count), both row-major, are filled when not null. False when p has
  /// no finite pixel: p is not finite, or it lies behind an imager whose model has a projection plane.
  bool project(std::span<const double> values,
               const Eigen::Vector3d& p,
               Eigen::Vector2d* px,
               double* d_px_d_p = nullptr,
               double* d_px_d_values = nullptr) const;

  /// As project(), for many points in one call, which is faster. `px` has one element for each point;
  /// `d_px_d_p` has, too, unless it is empty. False when any point has no finite pixel: then the contents of
  /// both are not meaningful.
  bool project_all(std::span<const double> values,
                   std::span<const Eigen::Vector3d> p,
                   std::span<Eigen::Vector2d> px,
                   std::span<PixelByPoint> d_px_d_p = {}) const;

  /// Unit direction that project() maps to px. False when there is none (px outside the model's domain).
  bool unproject(std::span<const double> values, const Eigen::Vector2d& px, Eigen::Vector3d* d_imager) const;

  bool operator==(const LensModel& other) const { return name() == other.name(); }

 private:
  struct Impl;
  std::shared_ptr<const Impl> impl_;
  explicit LensModel(std::shared_ptr<const Impl> impl) : impl_(std::move(impl)) {}
};

/// Largest focal length and largest coordinate of a principal point, in pixels. Larger ones are mistakes: an
/// image of 16384 pixels would be 0.1 degrees wide.
inline constexpr double k_largest_lens_px = 1e7;

/// A lens: model and values. Pixel (0,0) is the centre of the top-left pixel.
struct Lens {
  LensModel model;
  std::vector<double> values = {1, 1, 0, 0};

  /// Checks the number of values, that all are finite, that the focal lengths are positive, and that they and
  /// the principal point are at most k_largest_lens_px.
  static Result<Lens> create(const std::string& model_name, std::vector<double> values);
  static Lens pinhole(double fx, double fy, double cx, double cy);

  double fx() const { return values[0]; }
  double fy() const { return values[1]; }
  double cx() const { return values[2]; }
  double cy() const { return values[3]; }

  /// Pixel of p (imager frame); nullopt when p has none. A polynomial distortion can fold back on itself far
  /// off the axis, where LensModel::project returns the pixel of another direction; here the result is
  /// nullopt.
  std::optional<Eigen::Vector2d> project(const Eigen::Vector3d& p) const;
  /// Unit direction of a pixel; nullopt when it has none.
  std::optional<Eigen::Vector3d> unproject(const Eigen::Vector2d& px) const;
};

/// Unit directions of every `step`-th pixel of a width x height image, row by row, for baked maps and ray
/// tracing. There are ceil(height / step) * ceil(width / step) entries; entry (row, col) belongs to pixel
/// (col, row) * step. Pixels without a direction are NaN. The computation uses all cores.
std::vector<Eigen::Vector3f> direction_map(const Lens& lens, int width, int height, int step = 1);

}  // namespace limn
