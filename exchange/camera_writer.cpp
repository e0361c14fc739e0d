#include "exchange/camera_writer.h"

#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <string_view>

#include "core/camera_files/fisheye.h"
#include "core/camera_files/lens_fit.h"
#include "core/log.h"

namespace limn::exchange {
namespace {

// Directions of a grid of pixels over the image.
std::vector<LensSample> lens_samples(const Imager& imager, int grid) {
  std::vector<LensSample> samples;
  for (int row = 0; row <= grid; ++row) {
    for (int column = 0; column <= grid; ++column) {
      const Eigen::Vector2d px(imager.width * double(column) / grid - 0.5,
                               imager.height * double(row) / grid - 0.5);
      if (const auto d = imager.lens.unproject(px)) samples.push_back({*d, px});
    }
  }
  return samples;
}

bool fisheye_formula(std::span<const double> values,
                     const Eigen::Vector3d& d,
                     Eigen::Vector2d* px,
                     double* gradient) {
  const FisheyeLens lens{values[0], values[1], values[2],
                         values[3], 0,         {values[4], values[5], values[6], values[7]}};
  *px = lens.project(d);
  if (!gradient) return true;
  const double radius = d.head<2>().norm(), angle = std::atan2(radius, d.z());
  const Eigen::Vector2d outwards =
      radius > 0 ? Eigen::Vector2d(d.head<2>() / radius) : Eigen::Vector2d::Zero();
  Eigen::Map<Eigen::Matrix<double, 2, 8, Eigen::RowMajor>> by(gradient);
  by.setZero();
  by(0, 0) = (px->x() - lens.cx) / lens.fx;
  by(1, 1) = (px->y() - lens.cy) / lens.fy;
  by(0, 2) = by(1, 3) = 1;
  for (int i = 0; i < 4; ++i) {
    const double power = std::pow(angle, 2 * i + 3);
    by(0, 4 + i) = lens.fx * outwards.x() * power;
    by(1, 4 + i) = lens.fy * outwards.y() * power;
  }
  return px->allFinite();
}

WrittenLens fitted_lens(const Imager& imager, DistortionKind kind, int count) {
  const LensModel model =
      LensModel::parse(count == 0 ? "LENSMODEL_PINHOLE" : fmt::format("LENSMODEL_OPENCV{}", count)).value();
  const LensFormula formula =
      kind == DistortionKind::fisheye
          ? LensFormula(fisheye_formula)
          : [&](std::span<const double> values, const Eigen::Vector3d& d, Eigen::Vector2d* px,
                double* gradient) { return model.project(values, d, px, nullptr, gradient); };
  std::vector<double> start = {imager.lens.fx(), imager.lens.fy(), imager.lens.cx(), imager.lens.cy()};
  start.resize(4 + static_cast<std::size_t>(count), 0.0);
  constexpr int k_grid = 24;
  const auto values = fitted_values(formula, start, lens_samples(imager, k_grid));
  const double worst_px = worst_distance_px(formula, values, lens_samples(imager, 2 * k_grid));
  return {kind, values[0], values[1], values[2], values[3], {values.begin() + 4, values.end()}, worst_px};
}

// OpenCV's coefficients of a lens of its own formulas; nullopt for another.
std::optional<std::vector<double>> opencv_coefficients(const Lens& lens) {
  const std::string& model = lens.model.name();
  const bool is_opencv = model == "LENSMODEL_PINHOLE" || model.starts_with("LENSMODEL_OPENCV");
  if (!is_opencv) return std::nullopt;
  std::span<const double> coefficients = std::span(lens.values).subspan(4);
  while (!coefficients.empty() && coefficients.back() == 0)
    coefficients = coefficients.first(coefficients.size() - 1);
  return std::vector<double>(coefficients.begin(), coefficients.end());
}

// A number that YAML readers take as one: PyYAML takes 1e-05 as a text.
std::string yaml_number(double value) {
  std::string text = fmt::format("{}", value);
  if (text.find('.') != std::string::npos) return text;
  const auto exponent = std::min(text.find('e'), text.size());
  return text.insert(exponent, ".0");
}

std::string yaml_list(std::span<const double> values) {
  std::string list;
  for (const double value : values) list += (list.empty() ? "" : ", ") + yaml_number(value);
  return "[" + list + "]";
}

std::string matrix_list(const WrittenLens& lens) {
  return yaml_list(std::array{lens.fx, 0.0, lens.cx, 0.0, lens.fy, lens.cy, 0.0, 0.0, 1.0});
}

std::string opencv_matrix(std::string_view name,
                          std::size_t rows,
                          std::size_t columns,
                          const std::string& list) {
  return fmt::format("{}: !!opencv-matrix\n   rows: {}\n   cols: {}\n   dt: d\n   data: {}\n", name, rows,
                     columns, list);
}

std::string ros_matrix(std::string_view name,
                       std::size_t rows,
                       std::size_t columns,
                       const std::string& list) {
  return fmt::format("{}:\n  rows: {}\n  cols: {}\n  data: {}\n", name, rows, columns, list);
}

Status check_size(const Imager& imager) {
  if (imager.width > 0 && imager.height > 0) return {};
  return error("{}: expected an imager with a size, found none.", imager.name);
}

void report_conversion(const Imager& imager, const WrittenLens& lens, std::string_view format) {
  if (lens.worst_px == 0) return;
  log_info("export: {}: {} has no {}; the {} lens that is written is at most {:.4f} px off", imager.name,
           format, imager.lens.model.name(),
           lens.kind == DistortionKind::fisheye ? "fisheye (equidistant)" : "nearest", lens.worst_px);
}

}  // namespace

Result<WrittenLens> written_lens(const Imager& imager, std::span<const int> counts) {
  LIMN_TRY_STATUS(check_size(imager));
  const Lens& lens = imager.lens;
  if (auto coefficients = opencv_coefficients(lens)) {
    for (const int count : counts) {
      if (coefficients->size() > static_cast<std::size_t>(count)) continue;
      coefficients->resize(static_cast<std::size_t>(count), 0.0);
      return WrittenLens{DistortionKind::opencv, lens.fx(), lens.fy(), lens.cx(), lens.cy(),
                         *coefficients,          0};
    }
  }
  constexpr int k_most_fitted = 8;  // the thin prism adds nothing to a fit
  int count = counts[0];
  for (const int more : counts)
    if (more <= k_most_fitted) count = std::max(count, more);
  const WrittenLens bent = fitted_lens(imager, DistortionKind::opencv, count);
  const WrittenLens fisheye = fitted_lens(imager, DistortionKind::fisheye, 4);
  const WrittenLens& best = bent.worst_px <= fisheye.worst_px ? bent : fisheye;
  if (best.worst_px <= k_most_written_px) return best;
  return error(
      "{}: expected a lens that {} coefficients of OpenCV or a fisheye lens describe within {} px, found {}, "
      "which is {:.3f} "
      "px off. Use the rig's .cameramodel.",
      imager.name, count, k_most_written_px, lens.model.name(), best.worst_px);
}

Result<std::string> opencv_camera_text(const Imager& imager) {
  LIMN_TRY(const WrittenLens lens, written_lens(imager, std::array{5, 8, 12}));
  report_conversion(imager, lens, "OpenCV");
  const Eigen::Matrix<double, 4, 4, Eigen::RowMajor> pose = imager.imager_from_world.matrix();
  return "%YAML:1.0\n---\n" +
         fmt::format("image_width: {}\nimage_height: {}\nfisheye_model: {}\n", imager.width, imager.height,
                     lens.kind == DistortionKind::fisheye ? 1 : 0) +
         opencv_matrix("camera_matrix", 3, 3, matrix_list(lens)) +
         opencv_matrix("distortion_coefficients", 1, lens.coefficients.size(), yaml_list(lens.coefficients)) +
         opencv_matrix("camera_from_world", 4, 4, yaml_list({pose.data(), 16}));
}

Result<std::string> ros_camera_text(const Imager& imager) {
  LIMN_TRY(const WrittenLens lens, written_lens(imager, std::array{5, 8}));
  report_conversion(imager, lens, "ROS");
  const bool is_fisheye = lens.kind == DistortionKind::fisheye;
  const char* model = is_fisheye                      ? "equidistant"
                      : lens.coefficients.size() == 5 ? "plumb_bob"
                                                      : "rational_polynomial";
  return fmt::format("image_width: {}\nimage_height: {}\ncamera_name: {}\n", imager.width, imager.height,
                     imager.name) +
         ros_matrix("camera_matrix", 3, 3, matrix_list(lens)) + fmt::format("distortion_model: {}\n", model) +
         ros_matrix("distortion_coefficients", 1, lens.coefficients.size(), yaml_list(lens.coefficients)) +
         ros_matrix("rectification_matrix", 3, 3,
                    yaml_list(std::array{1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0})) +
         ros_matrix("projection_matrix", 3, 4,
                    yaml_list(std::array{lens.fx, 0.0, lens.cx, 0.0, 0.0, lens.fy, lens.cy, 0.0, 0.0, 0.0,
                                         1.0, 0.0}));
}

Result<std::string> kalibr_text(std::span<const Imager> imagers) {
  std::string text;
  for (std::size_t i = 0; i < imagers.size(); ++i) {
    const Imager& imager = imagers[i];
    LIMN_TRY(const WrittenLens lens, written_lens(imager, std::array{4}));
    report_conversion(imager, lens, "Kalibr");
    text += fmt::format("cam{}:\n", i);
    if (i > 0) {
      const Eigen::Matrix4d pose =
          (imager.imager_from_world * imagers[i - 1].imager_from_world.inverse()).matrix();
      text += "  T_cn_cnm1:\n";
      for (int row = 0; row < 4; ++row)
        text += "  - " + yaml_list(std::array{pose(row, 0), pose(row, 1), pose(row, 2), pose(row, 3)}) + "\n";
    }
    text += fmt::format(
        "  camera_model: pinhole\n  distortion_model: {}\n  distortion_coeffs: {}\n  intrinsics: {}\n  "
        "resolution: [{}, {}]\n  "
        "rostopic: /{}\n",
        lens.kind == DistortionKind::fisheye ? "equi" : "radtan", yaml_list(lens.coefficients),
        yaml_list(std::array{lens.fx, lens.fy, lens.cx, lens.cy}), imager.width, imager.height, imager.name);
  }
  return text;
}

}  // namespace limn::exchange
