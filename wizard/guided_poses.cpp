#include "wizard/guided_poses.h"

#include <algorithm>
#include <numbers>

namespace limn::wizard {
namespace {

// Position of the board's centre as shares of the image's width and height, its distance as a multiple of the
// middle distance, and its rotations about the camera's axes. Some boards stand on their sides: what an
// uneven print does turns with the board, and so is told from the lens.
struct Stance {
  double across, down, distance, about_x_deg, about_y_deg, turned_deg;
};

constexpr Stance k_stances[] = {
    {0.50, 0.50, 1.00, 0, 0, 0},     {0.32, 0.40, 1.00, 20, 25, 0},     {0.68, 0.40, 1.00, 20, -25, 0},
    {0.32, 0.62, 1.00, -25, 20, 10}, {0.68, 0.62, 1.00, -25, -20, -10}, {0.50, 0.36, 1.25, 30, 0, 90},
    {0.50, 0.64, 1.25, -30, 0, -90}, {0.26, 0.30, 1.35, 10, 30, 20},    {0.74, 0.30, 1.35, 10, -30, -20},
    {0.26, 0.70, 1.35, -10, 30, 0},  {0.74, 0.70, 1.35, -10, -30, 0},   {0.50, 0.50, 0.80, 15, 15, 90}};

constexpr double k_fill = 0.5;   // share of the image's width or height that the board fills
constexpr double k_focal = 1.2;  // focal length as a share of the image's width: about 45 degrees across

double radians(double degrees) { return degrees * std::numbers::pi / 180; }

}  // namespace

Imager assumed_camera(const std::string& name, int width, int height) {
  return {name, width, height,
          Lens::pinhole(k_focal * width, k_focal * width, (width - 1) / 2.0, (height - 1) / 2.0), Pose()};
}

std::vector<Pose> guided_poses(const Imager& camera, const calib::Board& board) {
  const double middle_m = std::max(camera.lens.fx() * board.width_m() / (k_fill * camera.width),
                                   camera.lens.fy() * board.height_m() / (k_fill * camera.height));
  const Pose board_from_middle(Eigen::Quaterniond::Identity(),
                               {board.width_m() / 2, board.height_m() / 2, 0});
  std::vector<Pose> poses;
  for (const Stance& stance : k_stances) {
    const Eigen::Vector2d px(stance.across * camera.width, stance.down * camera.height);
    const auto ray = camera.ray(px);
    LIMN_CHECK(ray.has_value());
    const Eigen::Vector3d d = ray->d / ray->d.z();
    const Eigen::Quaterniond turned(Eigen::AngleAxisd(radians(stance.about_y_deg), Eigen::Vector3d::UnitY()) *
                                    Eigen::AngleAxisd(radians(stance.about_x_deg), Eigen::Vector3d::UnitX()) *
                                    Eigen::AngleAxisd(radians(stance.turned_deg), Eigen::Vector3d::UnitZ()));
    poses.push_back(camera.imager_from_world.inverse() * Pose(turned, stance.distance * middle_m * d) *
                    board_from_middle.inverse());
  }
  return poses;
}

}  // namespace limn::wizard
