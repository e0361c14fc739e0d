#include "core/camera_files/camera_description.h"

#include <cmath>

#include "core/camera_files/fisheye.h"
#include "core/camera_files/splined_lens.h"

namespace limn {
namespace {

constexpr double k_least_focal_px = 10, k_most_focal_px = 1e6;
constexpr double k_most_coefficient = 1e8;

Error matrix_problem(const CameraDescription& camera, const std::string& expected) {
  const Eigen::Matrix3d& m = camera.matrix;
  return error("{}: expected {}, found [{:g}, {:g}, {:g}; {:g}, {:g}, {:g}; {:g}, {:g}, {:g}].",
               camera.matrix_entry, expected, m(0, 0), m(0, 1), m(0, 2), m(1, 0), m(1, 1), m(1, 2), m(2, 0),
               m(2, 1), m(2, 2));
}

Status check_shape(const CameraDescription& camera) {
  const Eigen::Matrix3d& m = camera.matrix;
  if (!m.allFinite()) return matrix_problem(camera, "finite numbers");
  if (m.isZero(0)) return matrix_problem(camera, "a calibrated camera's matrix");
  if ((m(2, 0) != 0 || m(2, 1) != 0) && m(0, 2) == 0 && m(1, 2) == 0)
    return matrix_problem(camera,
                          "a camera matrix row by row (fx 0 cx; 0 fy cy; 0 0 1) and not its transpose");
  if (m(2, 0) != 0 || m(2, 1) != 0 || m(2, 2) != 1 || m(1, 0) != 0)
    return matrix_problem(camera, "a camera matrix fx 0 cx; 0 fy cy; 0 0 1");
  // OpenCV's fisheye calibration estimates a small skew.
  const double most_skew = (camera.kind == DistortionKind::fisheye ? 0.05 : 1e-9) * std::abs(m(0, 0));
  if (!(std::abs(m(0, 1)) <= most_skew)) return matrix_problem(camera, "pixels without skew (0 beside fx)");
  return {};
}

Status check_sizes(const CameraDescription& camera) {
  const Eigen::Matrix3d& m = camera.matrix;
  for (const double focal : {m(0, 0), m(1, 1)}) {
    if (focal > 0 && focal < k_least_focal_px)
      return matrix_problem(
          camera,
          fmt::format("focal lengths in pixels (at least {}), not normalised ones or mm", k_least_focal_px));
    if (!(focal > 0 && focal <= k_most_focal_px))
      return matrix_problem(camera,
                            fmt::format("focal lengths from {} to {} px", k_least_focal_px, k_most_focal_px));
  }
  constexpr double k_most_aspect = 10;
  const double aspect = m(0, 0) / m(1, 1);
  if (aspect > k_most_aspect || aspect < 1 / k_most_aspect)
    return matrix_problem(camera, "focal lengths fx and fy of about the same size");
  // Without a size: the principal point is near the middle of an image that exists.
  const double width = camera.width > 0 ? camera.width : k_max_side;
  const double height = camera.height > 0 ? camera.height : k_max_side;
  constexpr double k_outside = 0.5;  // share of the image; cropped images have the point outside
  const double x = m(0, 2) / width, y = m(1, 2) / height;
  if (!(x >= -k_outside && x <= 1 + k_outside && y >= -k_outside && y <= 1 + k_outside))
    return matrix_problem(
        camera,
        fmt::format("a principal point near the image of {}x{} pixels (are width and height exchanged?)",
                    camera.width, camera.height));
  constexpr double k_corner = 0.02;
  if (camera.width > 0 && std::abs(x) < k_corner && std::abs(y) < k_corner)
    return matrix_problem(camera,
                          "the principal point in pixels from the top-left pixel, not from the centre");
  return {};
}

Status check_coefficients(const CameraDescription& camera) {
  for (const double value : camera.coefficients)
    if (!(std::abs(value) <= k_most_coefficient))
      return error("{}: expected numbers up to {:g}, found {:g}.", camera.distortion_entry,
                   k_most_coefficient, value);
  return {};
}

std::string size_text(const CameraDescription& camera) {
  return camera.width > 0 ? fmt::format("the image of {}x{} pixels", camera.width, camera.height)
                          : std::string("twice the distance from the image's edge to the principal point");
}

// The area that a converted lens must cover. Without a size the image is taken to end at twice the principal
// point; a half of that is added on each side, so that the point may lie well off the centre.
PixelArea area_of(const CameraDescription& camera) {
  if (camera.width > 0) return area_of_image(camera.width, camera.height);
  const Eigen::Vector2d centre(camera.matrix(0, 2), camera.matrix(1, 2));
  return {-0.5 * centre, 2.5 * centre};
}

Result<Lens> fisheye_lens(CameraDescription* camera) {
  auto& k = camera->coefficients;
  while (k.size() > 4 && k.back() == 0) k.pop_back();
  if (k.size() != 4)
    return error("{}: expected the 4 coefficients k1 to k4 of a fisheye lens, found {}.",
                 camera->distortion_entry, k.size());
  const Eigen::Matrix3d& m = camera->matrix;
  const FisheyeLens fisheye{m(0, 0), m(1, 1), m(0, 2), m(1, 2), m(0, 1), {k[0], k[1], k[2], k[3]}};
  const auto exact = [fisheye](const Eigen::Vector3d& d) { return fisheye.project(d); };
  auto lens = splined_lens(exact, Lens::pinhole(m(0, 0), m(1, 1), m(0, 2), m(1, 2)), area_of(*camera));
  if (!lens) return error("{}: {}", camera->distortion_entry, lens.message());
  camera->remarks.push_back(
      fmt::format("the fisheye (equidistant) lens was converted to {}, at most {:.4f} px off in {}",
                  lens->lens.model.name(), lens->worst_px, size_text(*camera)));
  return lens->lens;
}

Result<Lens> opencv_lens(CameraDescription* camera) {
  auto& c = camera->coefficients;
  if (c.size() == 14 && (c[12] != 0 || c[13] != 0))
    return error(
        "{}: expected a sensor that is not tilted (coefficients 13 and 14 are 0), found {:g} and {:g}. "
        "Calibrate without CALIB_TILTED_MODEL.",
        camera->distortion_entry, c[12], c[13]);
  while (c.size() > 12 && c.back() == 0) c.pop_back();
  for (const auto& [count, model] : {std::pair{0, "LENSMODEL_PINHOLE"}, std::pair{4, "LENSMODEL_OPENCV4"},
                                     std::pair{5, "LENSMODEL_OPENCV5"}, std::pair{8, "LENSMODEL_OPENCV8"},
                                     std::pair{12, "LENSMODEL_OPENCV12"}}) {
    if (static_cast<int>(c.size()) != count) continue;
    const Eigen::Matrix3d& m = camera->matrix;
    std::vector<double> values = {m(0, 0), m(1, 1), m(0, 2), m(1, 2)};
    values.insert(values.end(), c.begin(), c.end());
    return Lens::create(model, std::move(values));
  }
  return error(
      "{}: expected 4, 5, 8, 12 or 14 coefficients in OpenCV's order k1, k2, p1, p2, k3, …, found {}. Add "
      "zeros for those that the lens does not have (k1, k2, 0, 0).",
      camera->distortion_entry, c.size());
}

}  // namespace

Result<Imager> imager_of(CameraDescription* camera) {
  LIMN_TRY_STATUS(check_shape(*camera));
  LIMN_TRY_STATUS(check_sizes(*camera));
  LIMN_TRY_STATUS(check_coefficients(*camera));
  LIMN_TRY(Lens lens, camera->kind == DistortionKind::fisheye ? fisheye_lens(camera) : opencv_lens(camera));
  return Imager{camera->name, camera->width, camera->height, std::move(lens), camera->imager_from_world};
}

}  // namespace limn
