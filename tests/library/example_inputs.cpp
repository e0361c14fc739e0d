#include "tests/library/example_inputs.h"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <opencv2/imgproc.hpp>
#include <random>
#include <stdexcept>
#include <tuple>

#include "calib/board/board.h"
#include "calib/capture.h"
#include "calib/capture_set.h"
#include "core/cameramodel.h"
#include "core/config.h"
#include "core/file.h"
#include "core/image_io.h"
#include "scene/marker_file.h"
#include "scene/meshes/scan_surface.h"
#include "tests/tracker/marker_images.h"

namespace limn::test {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

void expect(const Status& status) {
  if (!status) throw std::runtime_error(status.message());
}

constexpr int k_samples = 3;  // on each side of a pixel

// The directions of a camera's rays through each pixel's samples, row by row.
std::vector<Vector3d> sample_rays(const Imager& camera) {
  std::vector<Vector3d> rays;
  for (int y = 0; y < camera.height * k_samples; ++y)
    for (int x = 0; x < camera.width * k_samples; ++x)
      rays.push_back(*camera.lens.unproject({(x + 0.5) / k_samples - 0.5, (y + 0.5) / k_samples - 0.5}));
  return rays;
}

// The board as the camera sees it along its rays.
cv::Mat photograph(const Imager& camera,
                   const std::vector<Vector3d>& rays,
                   const calib::BoardSheet& sheet,
                   const Pose& camera_from_board) {
  const Pose board_from_camera = camera_from_board.inverse();
  const Eigen::Matrix3d rotation = board_from_camera.rotation.toRotationMatrix();
  cv::Mat fine(camera.height * k_samples, camera.width * k_samples, CV_8U);
  for (int y = 0; y < fine.rows; ++y) {
    for (int x = 0; x < fine.cols; ++x) {
      const Vector3d d = rotation * rays[static_cast<std::size_t>(y * fine.cols + x)];
      const Vector3d p = board_from_camera.translation - board_from_camera.translation.z() / d.z() * d;
      const Vector2d at = sheet.px_board_origin + sheet.pixels_per_metre * p.head<2>();
      const int u = static_cast<int>(std::lround(at.x())), v = static_cast<int>(std::lround(at.y()));
      const bool is_ink = u >= 0 && v >= 0 && u < sheet.image.cols && v < sheet.image.rows &&
                          sheet.image.at<uchar>(v, u) == 0;
      fine.at<uchar>(y, x) = is_ink ? 25 : 200;
    }
  }
  cv::Mat image;
  cv::resize(fine, image, {camera.width, camera.height}, 0, 0, cv::INTER_AREA);
  return image;
}

constexpr double k_half_width_m = 0.25, k_half_height_m = 0.18;  // of the surface that is scanned

// A camera and a projector of 320 x 240 pixels that look down on the surface.
Rig scan_rig() {
  Rig rig;
  for (auto& [name, imagers, p_eye] : {std::tuple{"camera0", &rig.cameras, Vector3d(0.15, 0.1, 1)},
                                       std::tuple{"projector0", &rig.projectors, Vector3d(-0.25, 0.1, 1)}}) {
    imagers->push_back(
        {name, 320, 240, Lens::create("LENSMODEL_PINHOLE", {500, 500, 160, 120}).value(), Pose()});
    imagers->back().imager_from_world = looking_at(p_eye, {0, 0, 0}, {0, 1, 0});
  }
  return rig;
}

// For each pixel of the camera the projector's pixel that lights what it sees; far outside where it sees
// nothing.
cv::Mat lit_by(const Imager& camera, const Imager& projector) {
  const Pose surface_from_world = world_from_example_surface().inverse();
  cv::Mat map(camera.height, camera.width, CV_32FC2, cv::Scalar(-1e4, -1e4));
  for (int y = 0; y < map.rows; ++y) {
    for (int x = 0; x < map.cols; ++x) {
      const Ray ray = *camera.ray(Vector2d(x, y));
      const Vector3d p_begin = surface_from_world * ray.p_origin, d = surface_from_world.rotation * ray.d;
      Vector3d p = p_begin;
      for (int i = 0; i < 20; ++i) p += (example_height(p.x(), p.y()) - p.z()) / d.z() * d;
      const auto px = projector.project(world_from_example_surface() * p);
      if (px && std::abs(p.x()) < k_half_width_m && std::abs(p.y()) < k_half_height_m)
        map.at<cv::Vec2f>(y, x) = cv::Vec2f(static_cast<float>(px->x()), static_cast<float>(px->y()));
    }
  }
  return map;
}

// The surface's mesh, with a vertex each 5 mm.
scene::ScanSurface surface_mesh() {
  constexpr int k_columns = 101, k_rows = 73;
  scene::ScanSurface mesh;
  for (int y = 0; y < k_rows; ++y) {
    for (int x = 0; x < k_columns; ++x) {
      const double u = k_half_width_m * (2.0 * x / (k_columns - 1) - 1);
      const double v = k_half_height_m * (2.0 * y / (k_rows - 1) - 1);
      mesh.positions.push_back(Vector3d(u, v, example_height(u, v)).cast<float>());
    }
  }
  for (std::uint32_t y = 0; y + 1 < k_rows; ++y) {
    for (std::uint32_t x = 0; x + 1 < k_columns; ++x) {
      const std::uint32_t i = y * k_columns + x;
      mesh.triangles.push_back({i, i + 1, i + k_columns});
      mesh.triangles.push_back({i + 1, i + k_columns + 1, i + k_columns});
    }
  }
  return mesh;
}

}  // namespace

Imager example_camera() {
  Imager camera{"camera0", 640, 480, {}, Pose()};
  camera.lens = Lens::create("LENSMODEL_OPENCV4", {700, 700, 322, 238, -0.1, 0.05, 0, 0}).value();
  return camera;
}

Body example_body() {
  Body body{"body", {}};
  for (const int i : {0, 1})
    body.markers.push_back({{"apriltag_36h11", std::to_string(i)},
                            0.08,
                            Pose(Eigen::Quaterniond::Identity(), Vector3d(i == 0 ? -0.06 : 0.06, 0, 0))});
  return body;
}

Pose world_from_example_body(int i) {
  return {exp_rotation({0.5, 0.2, 0.02 * i}), Vector3d(-0.03 + 0.005 * i, 0.01, 0.7)};
}

cv::Mat example_image(int i) {
  const Imager camera = example_camera();
  std::vector<PlacedMarker> placed;
  for (const BodyMarker& marker : example_body().markers) {
    PlacedMarker one;
    one.marker = marker.marker;
    one.camera_from_marker = world_from_example_body(i) * marker.body_from_marker;
    one.size_m = marker.size_m;
    placed.push_back(one);
  }
  const cv::Mat background(camera.height, camera.width, CV_8U, cv::Scalar(120));
  std::mt19937_64 rng(static_cast<unsigned>(i));
  return image_of(camera.lens, background, placed, {.blur_px = 0.5, .noise_levels = 1}, rng);
}

Rig example_rig() {
  Rig rig;
  rig.cameras = {example_camera()};
  rig.cameras[0].imager_from_world = looking_at({0.1, 0.1, 1.2}, {0, 0, 0}, {0, 1, 0});
  rig.projectors = {rig.cameras[0]};
  rig.projectors[0].name = "projector0";
  rig.projectors[0].imager_from_world = looking_at({-0.3, 0.2, 1.1}, {0, 0, 0}, {0, 1, 0});
  return rig;
}

void write_example_video(const std::filesystem::path& folder, int count) {
  expect(make_folder(folder));
  expect(save_cameramodel(example_camera(), folder / "camera0.cameramodel"));
  expect(write_file(folder / "body.json", scene::marker_file_json(example_body().markers)));
  for (int i = 0; i < count; ++i) expect(write_png(folder / fmt::format("image{}.png", i), example_image(i)));
}

void write_example_photographs(const std::filesystem::path& folder, int count) {
  expect(make_folder(folder));
  const calib::Board board = calib::Board::parse(k_example_board).value();
  const calib::BoardSheet sheet = calib::draw_board(board, {.square_px = 48});
  const Pose middle(Eigen::Quaterniond::Identity(), Vector3d(-board.width_m() / 2, -board.height_m() / 2, 0));
  const std::vector<Vector3d> rays = sample_rays(example_camera());
  for (int i = 0; i < count; ++i) {
    const double around = 2.2 * i;
    const Pose camera_from_board(exp_rotation({0.45 * std::cos(around), 0.45 * std::sin(around), 0.1 * i}),
                                 Vector3d(0.05 * std::sin(around), 0.03 * std::cos(around), 0.6 + 0.02 * i));
    expect(write_png(folder / fmt::format("photo{}.png", i),
                     photograph(example_camera(), rays, sheet, camera_from_board * middle)));
  }
}

void write_example_scene(const std::filesystem::path& folder) {
  expect(save_rig(example_rig(), folder / "rig"));
  const Pose world_from_part(Eigen::Quaterniond::Identity(), Vector3d(0, 0, 0.05));
  const nlohmann::json poses = {
      {"world_from_prototype", to_json(Pose())},
      {"slots", {{"mirror", {{"world_from_part", to_json(world_from_part)}, {"variant", "sport"}}}}}};
  expect(write_file(folder / "poses.json", poses.dump()));
}

Pose world_from_example_surface() { return {exp_rotation({0, 0.05, 0}), Vector3d(0.02, -0.01, 0.03)}; }

double example_height(double x, double y) {
  return 0.03 * std::sin(9 * x + 0.5) * std::cos(7 * y - 0.3) + 0.02 * std::exp(-150 * (x * x + y * y));
}

void write_example_scan(const std::filesystem::path& folder) {
  const Rig rig = scan_rig();
  expect(save_rig(rig, folder / "rig"));
  expect(scene::save_ply(surface_mesh(), folder / "surface.ply"));
  Pose start = world_from_example_surface();
  start.translation += Vector3d(0.006, -0.006, 0.006);
  expect(write_file(folder / "start.json", nlohmann::json{{"world_from_prototype", to_json(start)}}.dump()));

  const calib::CaptureSet plan =
      calib::plan_captures(folder / "captures", {{"camera0", 320, 240}}, {{"projector0", 320, 240}},
                           calib::Board::parse(k_example_board).value());
  expect(calib::begin_captures(plan));
  const cv::Mat map = lit_by(rig.cameras[0], rig.projectors[0]);
  cv::Mat shown;
  expect(calib::capture_pose(plan, 0,
                             {.show =
                                  [&](int, const cv::Mat& image) {
                                    shown = image;
                                    return Status();
                                  },
                              .grab = [&](int) -> Result<cv::Mat> {
                                cv::Mat light, image;
                                cv::remap(shown, light, map, {}, cv::INTER_LINEAR, cv::BORDER_CONSTANT);
                                light.convertTo(image, CV_8U, 0.8, 20);
                                return image;
                              }}));
}

}  // namespace limn::test
