#include "core/imager_file.h"

#include <Eigen/Cholesky>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <vector>

#include "core/cameramodel.h"
#include "core/file.h"
#include "core/opencv_file.h"

namespace limn {
namespace {

namespace fs = std::filesystem;

// ---- OpenCV ----

using Names = std::initializer_list<const char*>;

const OpencvFile::Value* first_of(const OpencvFile& file, Names names) {
  for (const char* name : names)
    if (const auto* value = file.find(name)) return value;
  return nullptr;
}

// Elements of the matrix with one of these names; none if the file has no such matrix.
Result<std::vector<double>> numbers_of(const OpencvFile& file, Names names, const fs::path& path) {
  const OpencvFile::Value* value = first_of(file, names);
  if (!value) return std::vector<double>();
  const auto count = static_cast<double>(value->numbers.size());
  if (double{1} * value->rows * value->cols != count)
    return error("{}: {}: expected rows x cols = {} x {} numbers, found {}.", path.string(), *names.begin(),
                 value->rows, value->cols, count);
  return value->numbers;
}

Result<std::string> model_of_distortion(std::vector<double>* distortion, const fs::path& path) {
  while (distortion->size() > 12 && distortion->back() == 0) distortion->pop_back();
  switch (distortion->size()) {
    case 0:
      return std::string("LENSMODEL_PINHOLE");
    case 4:
      return std::string("LENSMODEL_OPENCV4");
    case 5:
      return std::string("LENSMODEL_OPENCV5");
    case 8:
      return std::string("LENSMODEL_OPENCV8");
    case 12:
      return std::string("LENSMODEL_OPENCV12");
    default:
      return error("{}: distortion_coefficients: expected 0, 4, 5, 8 or 12 numbers, found {}.", path.string(),
                   distortion->size());
  }
}

// Width or height in pixels; 0 if the file has none.
Result<int> side_of(const OpencvFile& file, Names names, const fs::path& path) {
  for (const char* name : names) {
    if (!file.find(name)) continue;
    const int side = file.integer(name).value_or(0);
    if (side >= 1 && side <= k_max_side) return side;
    return error("{}: {}: expected a whole number of pixels from 1 to {}.", path.string(), name, k_max_side);
  }
  return 0;
}

Result<Imager> load_opencv(const fs::path& path, const std::string& text) {
  const auto file = OpencvFile::parse(text);
  if (!file) return error("{}: expected an OpenCV camera file: {}", path.string(), file.message());
  LIMN_TRY(const auto matrix,
           numbers_of(*file, {"camera_matrix", "cameraMatrix", "Camera_Matrix", "K"}, path));
  if (matrix.size() != 9) {
    return error(
        "{}: camera_matrix: expected a 3x3 matrix as OpenCV's calibration writes it, found {} numbers.",
        path.string(), matrix.size());
  }
  LIMN_TRY(
      auto distortion,
      numbers_of(*file, {"distortion_coefficients", "distCoeffs", "Distortion_Coefficients", "D"}, path));
  LIMN_TRY(const std::string model, model_of_distortion(&distortion, path));
  std::vector<double> values = {matrix[0], matrix[4], matrix[2], matrix[5]};
  values.insert(values.end(), distortion.begin(), distortion.end());
  auto lens = Lens::create(model, values);
  if (!lens) return error("{}: {}", path.string(), lens.message());
  LIMN_TRY(const int width, side_of(*file, {"image_width", "image_Width"}, path));
  LIMN_TRY(const int height, side_of(*file, {"image_height", "image_Height"}, path));
  return Imager{path.stem().string(), width, height, *lens, Pose()};
}

// ---- ARToolKit ----

// Parameters of camera_para.dat: the 3x4 matrix gives an ideal pixel, which is then distorted in the image
// plane.
struct ArtoolkitCamera {
  int version = 0;
  int width = 0;
  int height = 0;
  std::vector<double> matrix;   // 3x4, row by row
  std::vector<double> factors;  // meaning depends on the version
};

// The observed pixel of an ideal one (ARToolKit's arParamIdeal2Observ, versions 1 to 4).
Eigen::Vector2d observed_pixel(const ArtoolkitCamera& camera, const Eigen::Vector2d& ideal) {
  const auto& d = camera.factors;
  if (camera.version == 4) {
    const Eigen::Vector2d f(d[4], d[5]), centre(d[6], d[7]);
    const Eigen::Vector2d n = ((ideal - centre) * d[8]).cwiseQuotient(f);
    const double r2 = n.squaredNorm(), radial = 1 + d[0] * r2 + d[1] * r2 * r2, xy2 = 2 * n.x() * n.y();
    const Eigen::Vector2d bent(n.x() * radial + d[2] * xy2 + d[3] * (r2 + 2 * n.x() * n.x()),
                               n.y() * radial + d[2] * (r2 + 2 * n.y() * n.y()) + d[3] * xy2);
    return bent.cwiseProduct(f) + centre;
  }
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

struct LensSample {
  Eigen::Vector3d p;  // direction, z = 1
  Eigen::Vector2d px;
};

constexpr int k_value_count = 12;  // number of values of LENSMODEL_OPENCV8

// Values of the LENSMODEL_OPENCV8 lens that fits the samples best in pixels, by Gauss-Newton from a pinhole.
std::vector<double> fitted_lens_values(const LensModel& model,
                                       std::vector<double> values,
                                       const std::vector<LensSample>& samples) {
  LIMN_CHECK(model.value_count() == k_value_count);
  const auto row_count = 2 * static_cast<Eigen::Index>(samples.size());
  Eigen::Matrix<double, Eigen::Dynamic, k_value_count, Eigen::RowMajor> jacobian(row_count, k_value_count);
  Eigen::VectorXd residuals(row_count);
  for (int iteration = 0; iteration < 20; ++iteration) {
    jacobian.setZero();
    residuals.setZero();
    Eigen::Index row = 0;
    for (const LensSample& sample : samples) {
      Eigen::Vector2d px;
      if (model.project(values, sample.p, &px, nullptr, jacobian.row(row).data()))
        residuals.segment<2>(row) = sample.px - px;
      row += 2;
    }
    Eigen::Matrix<double, k_value_count, k_value_count> hessian = jacobian.transpose() * jacobian;
    Eigen::Vector<double, k_value_count> gradient = jacobian.transpose() * residuals;
    hessian.diagonal().array() += 1e-9;
    // The numerator and denominator of OPENCV8 can cancel. Without this prior the fit puts poles into the
    // image.
    constexpr double k_distortion_weight = 1e-2;  // (0.1 px / 1)^2
    for (int i = 4; i < k_value_count; ++i) {
      hessian(i, i) += k_distortion_weight;
      gradient[i] -= k_distortion_weight * values[static_cast<std::size_t>(i)];
    }
    const Eigen::Vector<double, k_value_count> step = hessian.ldlt().solve(gradient);
    for (int i = 0; i < k_value_count; ++i) values[static_cast<std::size_t>(i)] += step[i];
    constexpr double k_settled_px = 1e-3;  // the next step would move pixels by far less
    const double moved_px = std::sqrt(step.dot(hessian * step) / static_cast<double>(samples.size()));
    if (!(moved_px > k_settled_px)) break;
  }
  return values;
}

// Whether the matrix is that of a pinhole and the distortion moves no corner by more than the image's
// diagonal.
bool is_camera(const ArtoolkitCamera& camera) {
  const auto& m = camera.matrix;
  const bool is_pinhole = m[0] > 0 && m[5] > 0 && m[8] == 0 && m[9] == 0 && m[10] == 1;
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

Result<ArtoolkitCamera> parse_artoolkit(const std::string& bytes, const fs::path& path) {
  constexpr std::size_t k_factor_counts[] = {4, 5, 6, 9};  // versions 1 to 4, recognised by the file's size
  ArtoolkitCamera camera;
  std::size_t at = 0;
  const auto read_bytes = [&](std::size_t size) {
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < size; ++i) value = value << 8 | static_cast<unsigned char>(bytes[at++]);
    return value;
  };
  for (int version = 1; version <= 4; ++version) {
    const std::size_t factor_count = k_factor_counts[version - 1];
    if (bytes.size() != 8 + 8 * (12 + factor_count)) continue;
    camera.version = version;
    camera.width = static_cast<int>(read_bytes(4));
    camera.height = static_cast<int>(read_bytes(4));
    for (int i = 0; i < 12; ++i) camera.matrix.push_back(std::bit_cast<double>(read_bytes(8)));
    for (std::size_t i = 0; i < factor_count; ++i)
      camera.factors.push_back(std::bit_cast<double>(read_bytes(8)));
  }
  const auto is_side = [](int side) { return side > 0 && side <= k_max_side; };
  bool sane = camera.version != 0 && is_side(camera.width) && is_side(camera.height);
  for (const double value : camera.matrix) sane = sane && std::isfinite(value);
  for (const double value : camera.factors) sane = sane && std::isfinite(value);
  if (!sane) {
    return error(
        "{}: expected an ARToolKit camera_para.dat of 136, 144, 152 or 176 bytes (versions 1 to 4), found "
        "{} bytes of something else.",
        path.string(), bytes.size());
  }
  return camera;
}

Result<Imager> load_artoolkit(const fs::path& path, const std::string& bytes) {
  LIMN_TRY(const ArtoolkitCamera camera, parse_artoolkit(bytes, path));
  if (!is_camera(camera))
    return error(
        "{}: expected a pinhole matrix (positive focal lengths, last row 0 0 1) and a distortion that moves "
        "the corners by less than the image's size, found something else. Is it an ARToolKit "
        "camera_para.dat?",
        path.string());
  const LensModel model = LensModel::parse("LENSMODEL_OPENCV8").value();
  constexpr int k_fit_grid = 12;  // 338 numbers for 12 values
  const auto& m = camera.matrix;
  auto lens =
      Lens::create(model.name(), fitted_lens_values(model, {m[0], m[5], m[2], m[6], 0, 0, 0, 0, 0, 0, 0, 0},
                                                    samples_of(camera, k_fit_grid)));
  if (!lens) return error("{}: {}", path.string(), lens.message());
  // The distortion of version 1 is circular in pixels, mrcal's in tangents; they differ by 0.18 px when
  // fy/fx = 1.036.
  constexpr double k_max_refit_px = 0.5;
  for (const LensSample& sample : samples_of(camera, 2 * k_fit_grid)) {
    const auto px = lens->project(sample.p);
    const double refit_px = px ? (*px - sample.px).norm() : INFINITY;
    if (refit_px <= k_max_refit_px) continue;
    return error(
        "{}: this ARToolKit distortion (version {}) is {:.2f} px from the nearest LENSMODEL_OPENCV8 at pixel "
        "({:.0f}, {:.0f}), expected at most {} px. Calibrate the camera with limn calibrate.",
        path.string(), camera.version, refit_px, sample.px.x(), sample.px.y(), k_max_refit_px);
  }
  return Imager{path.stem().string(), camera.width, camera.height, *lens, Pose()};
}

bool starts_like_filestorage(const std::string& text) {
  const auto first = text.find_first_not_of(" \t\r\n\xef\xbb\xbf");
  return first != std::string::npos && (text[first] == '%' || text[first] == '<' || text[first] == '{');
}

}  // namespace

Result<Imager> load_imager(const fs::path& path) {
  if (path.extension() == ".cameramodel") return load_cameramodel(path);
  LIMN_TRY(const std::string bytes, read_file(path));
  if (path.extension() == ".dat") return load_artoolkit(path, bytes);
  if (starts_like_filestorage(bytes)) return load_opencv(path, bytes);
  return error(
      "{}: expected a camera as .cameramodel, OpenCV YAML/XML/JSON or ARToolKit .dat, found something else.",
      path.string());
}

}  // namespace limn
