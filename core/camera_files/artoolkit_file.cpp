#include "core/camera_files/artoolkit_file.h"

#include <Eigen/LU>
#include <bit>
#include <cmath>
#include <cstdint>
#include <vector>

#include "core/camera_files/lens_fit.h"

namespace limn {
namespace {

constexpr std::size_t k_factor_counts[] = {4, 5, 6, 9, 17};  // versions 1 to 5

// Parameters of camera_para.dat: the 3x4 matrix gives an ideal pixel, which is then distorted in the image
// plane.
struct ArtoolkitCamera {
  int version = 0;
  int width = 0;
  int height = 0;
  std::vector<double> matrix;   // 3x4, row by row
  std::vector<double> factors;  // meaning depends on the version
};

// Versions 4 and 5: OpenCV's coefficients, then fx, fy, cx, cy and the scale of the ideal image.
bool has_opencv_lens(const ArtoolkitCamera& camera) { return camera.version >= 4; }

// The observed pixel of an ideal one (ARToolKit's arParamIdeal2Observ, versions 1 to 3).
Eigen::Vector2d observed_pixel(const ArtoolkitCamera& camera, const Eigen::Vector2d& ideal) {
  const auto& d = camera.factors;
  const Eigen::Vector2d centre(d[0], d[1]);
  const double scale =
      camera.version == 1 ? d[3] : d[2];  // in version 1 the scale comes after the radial factor
  const double aspect = camera.version == 3 ? d[3] : 1;
  const double k1 = camera.version == 1 ? d[2] : camera.version == 2 ? d[3] : d[4];
  const double k2 = camera.version == 1 ? 0 : camera.version == 2 ? d[4] : d[5];
  const Eigen::Vector2d n = (ideal - centre) * scale;
  const double r2 = n.squaredNorm();
  const Eigen::Vector2d bent = n * (1 - k1 * 1e-8 * r2 - k2 * 1e-13 * r2 * r2);
  return Eigen::Vector2d(bent.x() * aspect, bent.y()) + centre;
}

// Whether the matrix is that of a pinhole and the distortion moves no corner by more than the image's
// diagonal.
bool is_camera(const ArtoolkitCamera& camera) {
  const auto& m = camera.matrix;
  const bool is_pinhole = m[0] > 0 && m[5] > 0 && m[8] == 0 && m[9] == 0 && m[10] == 1;
  if (has_opencv_lens(camera)) return is_pinhole;
  const Eigen::Vector2d size(camera.width, camera.height);
  for (const Eigen::Vector2d& share :
       {Eigen::Vector2d(0, 0), Eigen::Vector2d(1, 0), Eigen::Vector2d(0, 1), Eigen::Vector2d(1, 1)}) {
    const Eigen::Vector2d ideal = share.cwiseProduct(size);
    if (!((observed_pixel(camera, ideal) - ideal).norm() < size.norm())) return false;
  }
  return is_pinhole;
}

// A grid of directions over the image, with their pixels by ARToolKit's model.
std::vector<LensSample> samples_of(const ArtoolkitCamera& camera, int grid) {
  Eigen::Matrix3d pinhole;
  for (int row = 0; row < 3; ++row) {
    for (int col = 0; col < 3; ++col)
      pinhole(row, col) = camera.matrix[static_cast<std::size_t>(4 * row + col)];
  }
  const Eigen::Matrix3d inverse = pinhole.inverse();
  std::vector<LensSample> samples;
  for (int row = 0; row <= grid; ++row) {
    for (int col = 0; col <= grid; ++col) {
      const Eigen::Vector2d ideal(double{1} * camera.width * col / grid,
                                  double{1} * camera.height * row / grid);
      const Eigen::Vector3d p = inverse * ideal.homogeneous();
      samples.push_back({p / p.z(), observed_pixel(camera, ideal)});
    }
  }
  return samples;
}

std::uint64_t big_endian_number(std::string_view bytes, std::size_t at, std::size_t size) {
  std::uint64_t value = 0;
  for (std::size_t i = 0; i < size; ++i) value = value << 8 | static_cast<unsigned char>(bytes[at + i]);
  return value;
}

ArtoolkitCamera parse_artoolkit(std::string_view bytes, int version) {
  ArtoolkitCamera camera;
  camera.version = version;
  camera.width = static_cast<int>(big_endian_number(bytes, 0, 4));
  camera.height = static_cast<int>(big_endian_number(bytes, 4, 4));
  for (std::size_t at = 8; at < bytes.size(); at += 8) {
    auto& numbers = camera.matrix.size() < 12 ? camera.matrix : camera.factors;
    numbers.push_back(std::bit_cast<double>(big_endian_number(bytes, at, 8)));
  }
  return camera;
}

// The factors say how an ideal pixel is bent, and the matrix how a point becomes an ideal pixel. Both have
// the same principal point, and the ideal image is smaller by the scale, in all files that ARToolKit writes.
Result<Lens> opencv_lens_of(const ArtoolkitCamera& camera) {
  const std::size_t coefficients = camera.version == 4 ? 4 : 12;
  const double* core = &camera.factors[coefficients];
  const double fx = core[0], fy = core[1], cx = core[2], cy = core[3], scale = core[4];
  const auto& m = camera.matrix;
  constexpr double k_rounded = 1e-6;
  const bool is_same = std::abs(m[0] * scale / fx - 1) < k_rounded &&
                       std::abs(m[5] * scale / fy - 1) < k_rounded && std::abs(m[2] - cx) < k_rounded * fx &&
                       std::abs(m[6] - cy) < k_rounded * fy && std::abs(m[1]) < k_rounded * fx;
  if (!is_same)
    return error(
        "expected a matrix with the focal lengths ({:g}, {:g}) / {:g} and the principal point ({:g}, {:g}) "
        "of the "
        "distortion, found ({:g}, {:g}) and ({:g}, {:g}).",
        fx, fy, scale, cx, cy, m[0], m[5], m[2], m[6]);
  std::vector<double> values = {fx, fy, cx, cy};
  values.insert(values.end(), camera.factors.begin(),
                camera.factors.begin() + static_cast<std::ptrdiff_t>(coefficients));
  return Lens::create(camera.version == 4 ? "LENSMODEL_OPENCV4" : "LENSMODEL_OPENCV12", std::move(values));
}

// Versions 1 to 3.
Result<Lens> refitted_lens(const ArtoolkitCamera& camera) {
  const LensModel model = LensModel::parse("LENSMODEL_OPENCV8").value();
  const LensFormula formula = [&](std::span<const double> values, const Eigen::Vector3d& d,
                                  Eigen::Vector2d* px, double* d_px_d_values) {
    return model.project(values, d, px, nullptr, d_px_d_values);
  };
  constexpr int k_fit_grid = 12;  // 338 numbers for 12 values
  const auto& m = camera.matrix;
  LIMN_TRY(const Lens lens,
           Lens::create(model.name(), fitted_values(formula, {m[0], m[5], m[2], m[6], 0, 0, 0, 0, 0, 0, 0, 0},
                                                    samples_of(camera, k_fit_grid))));
  // The distortion of version 1 is circular in pixels, mrcal's in tangents; they differ by 0.18 px when
  // fy/fx = 1.036.
  constexpr double k_max_refit_px = 0.5;
  for (const LensSample& sample : samples_of(camera, 2 * k_fit_grid)) {
    const auto px = lens.project(sample.d);
    const double refit_px = px ? (*px - sample.px).norm() : INFINITY;
    if (refit_px <= k_max_refit_px) continue;
    return error(
        "this ARToolKit distortion (version {}) is {:.2f} px from the nearest LENSMODEL_OPENCV8 at pixel "
        "({:.0f}, {:.0f}), expected at most {} px. Calibrate the camera with limn calibrate.",
        camera.version, refit_px, sample.px.x(), sample.px.y(), k_max_refit_px);
  }
  return lens;
}

}  // namespace

std::optional<int> artoolkit_version(std::string_view bytes) {
  for (int version = 1; version <= 5; ++version) {
    if (bytes.size() != 8 + 8 * (12 + k_factor_counts[version - 1])) continue;
    for (const std::size_t at : {0u, 4u}) {
      const auto side = big_endian_number(bytes, at, 4);
      if (side == 0 || side > k_max_side) return std::nullopt;
    }
    return version;
  }
  return std::nullopt;
}

Result<Imager> read_artoolkit(std::string_view bytes) {
  const auto version = artoolkit_version(bytes);
  if (!version)
    return error(
        "expected an ARToolKit camera_para.dat of 136, 144, 152, 176 or 240 bytes (versions 1 to 5), found "
        "{} bytes of "
        "something else.",
        bytes.size());
  const ArtoolkitCamera camera = parse_artoolkit(bytes, *version);
  bool is_finite = true;
  for (const auto* numbers : {&camera.matrix, &camera.factors})
    for (const double value : *numbers) is_finite = is_finite && std::isfinite(value);
  if (!is_finite || !is_camera(camera))
    return error(
        "expected a pinhole matrix (positive focal lengths, last row 0 0 1) and a distortion that moves the "
        "corners by "
        "less than the image's size, found something else. Is it an ARToolKit camera_para.dat?");
  LIMN_TRY(Lens lens, has_opencv_lens(camera) ? opencv_lens_of(camera) : refitted_lens(camera));
  return Imager{"", camera.width, camera.height, std::move(lens), Pose()};
}

}  // namespace limn
